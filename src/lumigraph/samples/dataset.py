"""Many drawn samples of a camera as one store, made by workers, resumable; and a card that describes it."""

import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph import io, store
from lumigraph.cluster import Cluster, Estimate, Local, Report, batch, inputs
from lumigraph.core.arrays import WORKERS, to_numpy
from lumigraph.core.linear import Linear
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError
from lumigraph.instruments import Instrument
from lumigraph.instruments.loading import camera_of
from lumigraph.io import series
from lumigraph.samples.drawn import LAYOUTS, TEXTURES, drawn

PARAMETERS = ("camera", "layout", "texture", "fill", "electrons_per_intensity")
"""Columns of the array of parameters: numbers of the camera, in `LAYOUTS` and in `TEXTURES`, and of light."""


@dataclass(frozen=True)
class Draws:
    """Work of a batch: the sample of a number.

    Parameters
    ----------
    cameras
        Camera files' texts, with their kinds; sample n is taken by camera n modulo their count.
    depths
        Depths of the scenes' planes from the focused plane [m].
    layouts
        Layouts, of `LAYOUTS`.
    photographs
        Files whose parts become textures.
    seed
        Seed of all random values.
    accuracy
        Error of the raw images before noise, relative rms.
    volume
        True to keep the intensities of all planes, too.
    """

    cameras: tuple[str, ...]
    depths: tuple[float, ...]
    layouts: tuple[str, ...]
    photographs: tuple[str, ...] = ()
    seed: int = 0
    accuracy: float = 1e-2
    volume: bool = False

    def __call__(self, number: int) -> Mapping[str, np.ndarray]:
        """Arrays of a sample: the same whoever makes it, and whatever was made before."""
        which = number % len(self.cameras)
        camera, operator = _seen(self.cameras[which], self.depths, self.accuracy)
        rng = np.random.default_rng([self.seed, number])
        pictures = _pictures(self.photographs)
        sample = drawn(operator, camera.sensor, rng, layouts=self.layouts, photographs=pictures)
        told = {"camera": which, **sample.raw.metadata, **sample.drawn}
        found = {"raw": np.asarray(sample.raw.data), "picture": sample.picture.astype(np.float32)}
        if "beads" not in self.layouts and sample.depth is not None:
            found["depth"] = sample.depth
        if self.volume:
            found["intensity"] = sample.intensity
        found["parameters"] = np.array([told.get(name, np.nan) for name in PARAMETERS], np.float64)
        return found


@lru_cache(4)
def _seen(text: str, depths: tuple[float, ...], accuracy: float) -> tuple[Instrument, Linear]:
    camera = camera_of(tomllib.loads(text), "the camera")
    return camera, camera.operator(depths, accuracy=accuracy)


@lru_cache(1)
def _pictures(files: tuple[str, ...]) -> Sequence[np.ndarray]:
    found = []
    for file in files:
        picture = io.open(file)
        if not isinstance(picture, RawImage):
            raise FormatError(f"{file} holds a {type(picture).__name__}, not a photograph. Leave it out.")
        found.append(np.asarray(to_numpy(picture.data), np.float32))
    return found


def card(work: Draws, count: int, layout: Mapping[str, Any], command: str) -> str:
    """Description of a data set in Markdown: arrays, ranges of what was drawn, cameras, how it was made."""
    about = {
        "raw": "what the sensor read, with photon and read noise [DN]",
        "picture": "the scene with all planes in focus, 0 to 1",
        "depth": "of each place from the focused plane, positive farther [m]",
        "intensity": "the scene's planes, 0 to 1",
        "parameters": ", ".join(PARAMETERS),
    }
    rows = [f"| `{name}` | {' x '.join(map(str, (count, *shape)))} | {kind} | {about[name]} |"
            for name, (shape, kind) in layout.items()]  # fmt: skip
    depths = ", ".join(f"{1e3 * dz:.6g} mm" for dz in work.depths)
    limits = (
        "Light adds up: where patches meet, the near one hides nothing of what is behind it. Depths are "
        "those of the planes listed; slanted planes rise in steps."
    )
    lines = [
        f"# {count} raw images with truth", "",
        f"Simulated by wave optics with lumigraph {version('lumigraph')}, incoherent light, to a relative "
        f"rms of {work.accuracy:g} before noise. {limits}", "",
        "| array | shape | type | |", "|---|---|---|---|", *rows, "",
        f"Planes: {depths}. Layouts: {', '.join(f'{k} {name}' for k, name in enumerate(LAYOUTS))}. "
        f"Textures: {', '.join(f'{k} {name}' for k, name in enumerate(TEXTURES))}. Seed: {work.seed}.", "",
        "```sh", command, "```", "",
    ]  # fmt: skip
    for k, text in enumerate(work.cameras):
        lines += [f"## Camera {k}", "", "```toml", text.strip(), "```", ""]
    return "\n".join(lines)


def dataset(
    work: Draws, count: int, output: Path, *, workers: Cluster | None = None, part: tuple[int, int] = (1, 1),
    progress: Progress = silent, estimated: Callable[[Estimate], None] | None = None, command: str = "",
) -> Report:  # fmt: skip
    """Make samples 0 to `count` - 1 into a Zarr store, and its card beside it (``.md``).

    Parameters
    ----------
    work
        Description of what is drawn.
    count
        Samples.
    output
        Zarr store (.zarr); what is there already is kept.
    workers, part, progress, estimated
        As `cluster.batch` takes them.
    command
        Command line for the card.

    Raises
    ------
    FormatError
        A store of something else.
    """
    described = asdict(work)
    what = {"dataset": json.loads(json.dumps(described)), "parameters": list(PARAMETERS)}
    read = [*work.photographs, *(file for text in work.cameras for file in inputs.named_in(text))]
    found = batch(
        work, list(range(count)), output, what=what, inputs=read,
        workers=workers or Local(WORKERS), part=part, progress=progress, estimated=estimated,
    )  # fmt: skip
    if found.done:
        told = card(work, count, _layout(output), command)
        store.write_bytes(output.with_name(f"{output.name}.md"), told.encode())
    return found


def _layout(output: Path) -> dict[str, Any]:
    return series.described(output)["layout"]
