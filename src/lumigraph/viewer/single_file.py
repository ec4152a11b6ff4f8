"""The page as one file that works from disk, offline, and from any web server."""

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lumigraph.core.progress import Progress, Stage
from lumigraph.errors import LumigraphError
from lumigraph.io.target import check_target, write_bytes
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.packing import check_quality, packed
from lumigraph.viewer.page import MODULES, about, html_of, pictures, static
from lumigraph.viewer.parts import Parts

LARGEST = 400 << 20
"""Bytes: browsers hold a page's text in strings of little more than 512 MiB."""


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export: path and sizes [bytes].

    Parameters
    ----------
    path
        The page.
    size
        Bytes of the page.
    arrays
        Bytes of each array in it, by name.
    """

    path: Path
    size: int
    arrays: dict[str, int]


def export(
    exhibits: Sequence[Exhibit], path: Path, *, quality: int = 90, progress: Progress | None = None
) -> Exported:
    """Write one self-contained page.

    Parameters
    ----------
    exhibits
        One, or two side by side.
    path
        HTML file.
    quality
        Of the views as WebP pictures, 1 to 99; 100 keeps every number.
    progress
        Called as ``progress(fraction)``, a `core.progress.Stage`.

    Raises
    ------
    LumigraphError
        The quality is not 1 to 100, or the page would be too large for a browser.
    FormatError
        The folder does not exist or the name does not end in .html.
    """
    path = check_target(path, (".html", ".htm"))
    text, sizes = exported(exhibits, quality, progress)
    write_bytes(path, text.encode())
    return Exported(path, len(text.encode()), sizes)


def exported(
    exhibits: Sequence[Exhibit], quality: int, progress: Progress | None = None
) -> tuple[str, dict[str, int]]:
    """The page as text, and the bytes of each array in it; as `export`, which writes it."""
    check_quality(quality)
    parts = [Parts.of(exhibit, written=True) for exhibit in exhibits]
    names = [(number, name) for number, part in enumerate(parts) for name in part.arrays]
    blobs: dict[str, str] = {}
    sizes: dict[str, int] = {}
    for k, (number, name) in enumerate(names):
        if progress is not None:
            progress(Stage(k / len(names), name))
        coded = parts[number].arrays[name]()
        content = packed(name, pictures(coded) if name == "views" else coded, parts[number], quality)
        sizes[f"{number}/{name}"] = len(content)
        if sum(sizes.values()) * 4 / 3 > LARGEST:
            raise LumigraphError(
                f"the page would have more than {LARGEST >> 20} MiB, which browsers do not open. "
                "Lower --quality, or export fewer views."
            )
        blobs[f"{number}/{name}"] = base64.b64encode(content).decode()
    return document(json.dumps(about(parts)), blobs), sizes


def document(description: str, blobs: dict[str, str]) -> str:
    """The page with everything inside: styles and script allowed by their hashes alone, no connections."""
    script, style = bundle(), static("style.css")
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    page = html_of("index.html")
    data = [_inert("data-about", "application/json", description.replace("<", "\\u003c"))]
    data += [_inert(f"data-{name}", "text/plain", blob) for name, blob in blobs.items()]
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    for old, new in (
        ('<meta charset="utf-8">', f'<meta charset="utf-8">\n{head}'),
        ('<link rel="stylesheet" href="app/style.css">', f"<style>{style}</style>"),
        (
            '<script type="module" src="app/main.js"></script>',
            "\n".join(data) + f'\n<script type="module">{script}</script>',
        ),
    ):
        if page.count(old) != 1:
            raise LumigraphError(f"the page lacks {old!r}. Install lumigraph again.")
        page = page.replace(old, new)
    return page


def bundle() -> str:
    """All modules as one script: each in a function that returns the module's exports."""
    return "\n" + "\n".join(_enclosed(static(name)) for name in MODULES)


def _enclosed(text: str) -> str:
    text = re.sub(r"^import\s[^;]*;\n", "", text, flags=re.MULTILINE)
    start = r"^export (?=(?:async )?(?:function|class|const) (\w+))"
    names = ", ".join(re.findall(start, text, flags=re.MULTILINE))
    body = re.sub(start, "", text, flags=re.MULTILINE)
    return f"const {{ {names} }} = (() => {{\n{body}return {{ {names} }};\n}})();"


def _inert(name: str, kind: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">{text}</script>'


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
