"""`lumigraph information`: how well a point of light can be placed by one raw image."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli.console import progress
from lumigraph.cli.options import planes as planes_of
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Quantity, Result

if TYPE_CHECKING:
    from lumigraph.studies.information import Bounds

Depths = Annotated[list[str], Parameter(allow_leading_hyphen=True, negative="")]


def information(
    camera: str,
    /,
    *,
    depth: Depths,
    photons: Annotated[float, Parameter(allow_leading_hyphen=True)] = 10_000.0,
    background: Annotated[float, Parameter(allow_leading_hyphen=True)] = 0.0,
    places: Annotated[int, Parameter(allow_leading_hyphen=True)] = 4,
    common: ReportOptions = REPORTED,
) -> Result:
    """Print how well a point of light can be placed by one raw image: Cramér-Rao bounds over a volume.

    No unbiased estimate of its place, depth and brightness, all of them unknown, has smaller errors. Noise is
    that of photons and of the camera file's sensor.

    Example: `lumigraph information lfm-fourier --depth "-20 um:20 um:5 um" --photons 5000`

    Example: `lumigraph information camera.toml --depth "-10 mm:10 mm:5 mm" --background 2 --json`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one.
    depth
        Depths from the focused plane, such as '-20 um:20 um:5 um', or several, separated by commas.
    photons
        Photons of the point that enter the main lens or objective in one exposure.
    background
        Photons of even light on each pixel, whose number is unknown too.
    places
        Places at each depth, over the cell of a lenslet; without lenslets before the focused plane, a pixel.
    """
    from lumigraph.instruments import load_camera
    from lumigraph.studies.information import Light, bounds

    common.check()
    planes = planes_of("--depth", depth)
    light = Light(photons, background)
    instrument = load_camera(camera)
    with progress("information") as shown:
        found = bounds(instrument, planes, light, places=places, progress=shown)
    return _result(found)


def _result(found: "Bounds") -> Result:
    rows = _rows(found)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    table = ["  ".join(cell.rjust(n) for cell, n in zip(row, widths, strict=True)) for row in rows]
    summary = f"over the volume: {', '.join(f'{one.label} {one}' for one in found.quantities())}"
    return Result(
        "Information", "How well a point of light can be placed by one raw image, at best.", found,
        (*table, summary), found.quantities(), lambda: _figures(found, rows), tuple(_notes(found)),
        extra={"depths": found.rows()},
    )  # fmt: skip


def _rows(found: "Bounds") -> list[tuple[str, ...]]:
    """Standard deviations at each depth as text, their header first."""
    header = ("depth", "light caught", "y", "x", "dz", "brightness", "background")
    rows = []
    for dz, caught, some in zip(found.depths, found.caught, found.over_depths, strict=True):
        lengths = (_length(v) for v in some[:3])
        rows.append(
            (
                _length(dz),
                f"{caught:.1%}",
                *lengths,
                *(f"{v:.2%}" if v < 1e3 else "not told" for v in some[3:]),
            )
        )
    return [header[: len(rows[0])], *rows]


def _length(value: float) -> str:
    return str(Quantity("length", float(value), "m")) if abs(value) < 1e3 else "not told"


def _notes(found: "Bounds") -> Iterator[str]:
    import numpy as np

    if np.max(found.errors) > 0:
        yield (
            f"derivatives are central differences; a second step says that they are within "
            f"{np.max(found.errors):.1%}, rms"
        )
    if np.isinf(found.deviations).any():
        yield "at some places the raw image does not determine all, such as the side of the focus"


def _figures(found: "Bounds", rows: list[tuple[str, ...]]) -> Iterator[Figure]:
    from lumigraph import plots

    yield Figure(rows, section="Bounds")
    if len(found.depths) > 1:
        drawn = plots.over_depth(
            found.depths, dict(zip(("y", "x", "dz"), found.over_depths.T, strict=False)),
            "least standard deviation",
        )  # fmt: skip
        yield Figure(drawn, "Least standard deviations over depth.", "Bounds")
