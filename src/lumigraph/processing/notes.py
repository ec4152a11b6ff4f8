"""The page of notes."""

import re
from collections.abc import Iterable, Sequence

from lumigraph.core import notes as core
from lumigraph.processing.recognise import Guess

_SAID = (
    re.compile(r"the (dark|white) image is (subtracted|divided out|in the model)"),
    re.compile(r"the lattice (is that of|was found on) .*"),
)
"""Notes that say what a guess says already."""

_FILES = {
    "all-in-focus.png": "picture that is sharp at every depth",
    "depth.png": "near to far as white to black, unknown as black",
    "depth.tiff": "the same as numbers",
    "refocus.gif": "film of the focus that moves from one end to the other",
    "page.html": "the viewer with everything inside: open it in any browser, or send it",
    "views.zarr": "the views; 'lumigraph view', 'refocus' and 'depth' read them",
    "volume.ome.tif": "the volume, for Fiji, napari and others",
    "calibration.toml": "the lattice of the micro-images; --calibration of every verb takes it",
}


def mattering(notes: Iterable[str]) -> tuple[str, ...]:
    """Notes of `core.notes.mattering` that no guess says already, each once."""
    return core.mattering(notes, _SAID)


def page(name: str, guesses: Sequence[Guess], notes: Sequence[str], files: Iterable[str]) -> str:
    """Notes as Markdown: what was found out and why, what to know, what the files are."""
    lines = [f"# {name}", "", "## Found out", ""]
    lines += [f"- {guess.what}: **{guess.value}**, since {guess.reason}" for guess in guesses]
    lines += ["", "## What to know", "", *(f"- {note}" for note in notes)]
    lines += ["", "## Files", "", *(f"- `{file}`: {_FILES[file]}" for file in files if file in _FILES)]
    return "\n".join((*lines, ""))
