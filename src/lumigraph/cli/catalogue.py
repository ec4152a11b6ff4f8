"""`lumigraph catalogue`."""

from typing import TYPE_CHECKING

from lumigraph.cli.options import COMMON, Common
from lumigraph.core.result import Result

if TYPE_CHECKING:
    from lumigraph.instruments import Instrument

_FIGURES = {
    "kind": (), "wavelength": ("wavelength",), "lenslets": ("lenslets",),
    "lenslet pitch": ("lenslet pitch",),
    "aperture": ("numerical aperture", "f-number"), "views": ("views per axis", "directions per axis"),
    "resolves": ("finest period", "lateral resolution"), "pixels": ("pixels",),
    "pixel pitch": ("pixel pitch",),
}  # fmt: skip
"""Columns of the table, and the quantities of a camera that they take: the first that it has."""


def catalogue(*, common: Common = COMMON) -> Result:
    """List the cameras and microscopes that come with lumigraph, with their key figures.

    Every verb that takes a camera file accepts their names; `lumigraph design NAME` prints all that follows.

    Example: `lumigraph catalogue`

    Example: `lumigraph catalogue --json`
    """
    from lumigraph.instruments import catalogue as names
    from lumigraph.instruments import load_camera

    cameras = {name: load_camera(name) for name in names()}
    rows = [_row(name, camera) for name, camera in cameras.items()]
    lines = _aligned([("name", *_FIGURES), *rows])
    values = {name: {"kind": camera.noun, **camera.describe().as_dict()} for name, camera in cameras.items()}
    return Result("Catalogue", "Cameras that come with lumigraph.", cameras, tuple(lines), extra=values)


def _row(name: str, camera: "Instrument") -> tuple[str, ...]:
    from lumigraph.instruments.capabilities import WithObjective

    found = {row.name: row.text for row in camera.quantities()}
    if isinstance(camera, WithObjective):
        found["numerical aperture"] = f"NA {found['numerical aperture']}"
    else:
        found["numerical aperture"] = f"f/{found['f-number']}"
    figures = [next((found[each] for each in names if each in found), "") for names in _FIGURES.values()]
    return name, camera.noun, *figures[1:]


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
