"""`lumigraph measure`."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import Parameter

from lumigraph.cli.options import above_zero, length, region, section
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    import numpy as np

    from lumigraph.analysis import SlantedEdge
    from lumigraph.analysis.photon_transfer import PhotonTransfer
    from lumigraph.core.raw import RawImage


@Parameter(name="*", group=section("Region"))
@dataclass(frozen=True)
class RegionOptions:
    """Part of the pictures to measure.

    Parameters
    ----------
    region
        Rows and columns, such as '100:180, 40:120'; the whole picture if left out.
    pixel_pitch
        Pixel pitch, such as '5 um'; the file's if left out. Without one, frequencies are in cycles per pixel.
    """

    region: str | None = None
    pixel_pitch: str | None = None

    def cut(self, picture: "RawImage") -> "np.ndarray":
        """The region of a picture (y, x), colours averaged."""
        import numpy as np

        if picture.bayer is not None:
            raise FormatError(f"the picture is a {picture.bayer} mosaic. Demosaic it, by lumigraph.demosaic.")
        data = np.asarray(picture.data)
        grey = data if data.ndim == 2 else data.mean(-1)
        return grey if self.region is None else grey[region(self.region, grey.shape)]

    def pixels(self, picture: "RawImage") -> float | None:
        """Pitch [m], or None where neither the option nor the file says."""
        return length("--pixel-pitch", self.pixel_pitch) or picture.pixel_pitch


@Parameter(name="*", group=section("Dark images"))
@dataclass(frozen=True)
class DarkOptions:
    """Dark pictures and range of a sensor, for its flats.

    Parameters
    ----------
    dark
        Pictures without light, two of each exposure time; the first two have the flats' own.
    exposure_time
        Exposure time of each pair of darks, such as '10 ms': separates dark current from black level.
    full_scale
        Largest number that the sensor reads; by the file's bit depth if left out.
    """

    dark: list[Path] | None = None
    exposure_time: list[str] | None = None
    full_scale: float | None = None


def measure(
    what: Literal["edge", "point", "noise", "sensor"],
    pictures: list[Path],
    /,
    *,
    looked: RegionOptions = RegionOptions(),
    dark: DarkOptions = DarkOptions(),
    common: ReportOptions = REPORTED,
) -> Result:
    """Measure how sharp or how noisy pictures are.

    edge: the MTF across a slanted edge (ISO 12233). point: widths, energy and MTF of a point's image.
    noise: mean over standard deviation of an even area; of two pictures, noise in time and fixed pattern.
    sensor: gain, noise, dark signal and full well by photon transfer (EMVA 1288), from pairs of pictures.

    Example: `lumigraph measure edge picture.tiff --region "100:180, 40:120"`

    Example: `lumigraph measure sensor a1.tiff a2.tiff b1.tiff b2.tiff --dark d1.tiff --dark d2.tiff`

    Parameters
    ----------
    what
        edge, point, noise or sensor.
    pictures
        Picture files, or stacks: one edge, one point, one or two even pictures, or pairs of flats.
    """
    common.check()
    if what != "sensor" and dark != DarkOptions():
        raise FormatError(f"--dark, --exposure-time and --full-scale are for 'sensor', not for {what!r}.")
    from lumigraph.preparation.given import read_pages

    opened = [page for path in pictures for page in read_pages(path, "all").values()]
    _check_count(what, len(opened))
    areas = [looked.cut(picture) for picture in opened]
    pitch = looked.pixels(opened[0])
    if what == "edge":
        return _edge(areas[0], pitch)
    if what == "point":
        return _point(areas[0], pitch)
    return _noise(areas) if what == "noise" else _sensor(areas, opened[0].bit_depth, looked, dark)


_COUNTS = {
    "edge": "one picture",
    "point": "one picture",
    "noise": "one or two pictures",
    "sensor": "pairs of flats",
}


def _check_count(what: str, n: int) -> None:
    fits = {"edge": n == 1, "point": n == 1, "noise": n in (1, 2), "sensor": n > 0 and n % 2 == 0}
    if not fits[what]:
        raise FormatError(f"measure {what} takes {_COUNTS[what]}, not {n} pictures.")


def _edge(area: "np.ndarray", pitch: float | None) -> Result:
    import math

    from lumigraph.analysis import slanted_edge

    found = slanted_edge(area, pitch)
    unit = "1/m" if pitch else "cycles/px"
    quantities = [
        *_frequencies(found.frequencies, found.mtf, unit),
        Quantity("angle", math.degrees(found.angle), "deg"),
        Quantity("levels", found.levels),
    ]
    return _result(
        "Edge", "The MTF across a slanted edge, the pixels' own blur in it.", found, quantities,
        lambda: _edge_figures(area, found, unit),
    )  # fmt: skip


def _frequencies(frequencies: "np.ndarray", mtf: "np.ndarray", unit: str) -> list[Quantity]:
    """Frequencies at which contrast falls to a half and a tenth, as far as it does."""
    from lumigraph.analysis import cutoff

    return [
        Quantity(f"mtf{percent}", cutoff(frequencies, mtf, percent / 100), unit)
        for percent in (50, 10)
        if (mtf < percent / 100).any()
    ]


def _edge_figures(area: "np.ndarray", found: "SlantedEdge", unit: str) -> Iterable[Figure]:
    from lumigraph import plots

    yield Figure(area, "What was measured.")
    label = "frequency [1/mm]" if unit == "1/m" else f"frequency [{unit}]"
    scale = 1e-3 if unit == "1/m" else 1.0
    curve = plots.curves(found.frequencies * scale, {"MTF": found.mtf}, xlabel=label, ylabel="contrast")
    yield Figure(curve, "Contrast that is left of each frequency; above half a cycle per pixel it aliases.")
    profile = plots.curves(
        found.position * (1e6 if unit == "1/m" else 1), {"edge": found.spread},
        xlabel="across the edge [um]" if unit == "1/m" else "across the edge [px]", ylabel="level",
    )  # fmt: skip
    yield Figure(profile, "The edge, sampled four times as finely as the pixels.")


def _point(area: "np.ndarray", pitch: float | None) -> Result:
    import numpy as np

    from lumigraph.analysis import full_width, mtf

    light = area - float(np.median(area))
    y, x = (int(n) for n in np.unravel_index(np.argmax(light), light.shape))
    scale, unit = (pitch, "m") if pitch else (1.0, "px")
    widths = (
        full_width(np.arange(light.shape[0]) * scale, light[:, x]),
        full_width(np.arange(light.shape[1]) * scale, light[y]),
    )
    frequencies, contrast = mtf(light, scale)
    quantities = [
        Quantity("width_y", widths[0], unit), Quantity("width_x", widths[1], unit),
        *(Quantity(f"radius_of_{part}_percent", radius * scale, unit) for part, radius in _radii(light)),
        *_frequencies(frequencies, contrast, "1/m" if pitch else "cycles/px"),
        Quantity("brightest_pixel", (y, x)), Quantity("background", float(np.median(area))),
    ]  # fmt: skip
    about = (
        "A point's image: full widths at half maximum, radii that hold a part of the light, and MTF along x."
    )
    return _result("Point", about, light, quantities, lambda: [Figure(light, "Less the median.")])


def _radii(light: "np.ndarray") -> Iterable[tuple[int, float]]:
    """Radii [px] about the centre of gravity that hold half and four fifths of the light."""
    import numpy as np

    y, x = np.indices(light.shape)
    total = light.sum()
    away = np.hypot(y - (y * light).sum() / total, x - (x * light).sum() / total).ravel()
    order = np.argsort(away)
    grown = np.cumsum(light.ravel()[order]) / total
    for percent in (50, 80):
        yield percent, float(away[order][np.argmax(grown >= percent / 100)])


def _noise(areas: "list[np.ndarray]") -> Result:
    import math

    import numpy as np

    first = areas[0].astype(float)
    mean, spread = float(first.mean()), float(first.std())
    quantities = [
        Quantity("mean", mean, "counts"), Quantity("standard_deviation", spread, "counts"),
        Quantity("snr", mean / spread if spread else math.inf),
    ]  # fmt: skip
    if len(areas) == 2:
        if areas[1].shape != areas[0].shape:
            raise FormatError(
                f"the pictures have {areas[0].shape} and {areas[1].shape} pixels. Give two alike."
            )
        second = areas[1].astype(float)
        in_time = math.sqrt(float(np.var(first - second)) / 2)
        fixed = float(np.mean((first - mean) * (second - second.mean())))
        quantities += [
            Quantity("noise_in_time", in_time, "counts"),
            Quantity("snr_in_time", mean / in_time if in_time else math.inf),
            Quantity("fixed_pattern", math.sqrt(max(fixed, 0.0)), "counts"),
        ]
    about = "Mean over standard deviation of an even area; the light's own unevenness counts as noise."
    return _result("Noise", about, areas, quantities, lambda: [Figure(areas[0], "What was measured.")])


def _sensor(areas: "list[np.ndarray]", bits: int | None, looked: RegionOptions, dark: DarkOptions) -> Result:
    from lumigraph.analysis import photon_transfer
    from lumigraph.preparation.given import read_raw
    from lumigraph.units import parse

    if not dark.dark or len(dark.dark) % 2:
        raise FormatError(f"there are {len(dark.dark or [])} --dark. Give two of each exposure time.")
    unlit = [looked.cut(read_raw(path, "dark picture")) for path in dark.dark]
    top = above_zero("--full-scale", dark.full_scale)
    found = photon_transfer(
        _pairs(areas), _pairs(unlit),
        exposure_times=[parse(text, "time") for text in dark.exposure_time] if dark.exposure_time else None,
        full_scale=top if top is not None or bits is None else 2.0**bits - 1,
    )  # fmt: skip
    about = "Photon transfer: a pixel's variance grows with its mean by one over the gain. Intervals: 95 %."
    return _result("Sensor", about, found, _found(found), lambda: _curve(found))


def _pairs(images: list[Any]) -> list[tuple[Any, Any]]:
    return list(zip(images[::2], images[1::2], strict=True))


def _found(found: "PhotonTransfer") -> list[Quantity]:
    def within(name: str, unit: str) -> Quantity:
        value, error = getattr(found, name), getattr(found, f"{name}_error")
        return Quantity(name, value, unit, (value - 1.96 * error, value + 1.96 * error))

    known = [
        within("gain", "electrons/count"), within("dark_signal", "counts"), within("dark_noise", "electrons"),
        Quantity("read_noise", found.read_noise, "electrons"),
        Quantity("dark_current", found.dark_current, "electrons/s"),
        Quantity("black_level", found.black_level, "counts"),
        Quantity("full_well", found.full_well, "electrons"),
        Quantity("prnu", found.prnu), Quantity("dsnu", found.dsnu, "electrons"),
    ]  # fmt: skip
    return [one for one in known if one.value is not None]


def _curve(found: "PhotonTransfer") -> Iterable[Figure]:
    from lumigraph import plots

    lines = {"flats": (found.means, found.variances), "fit": (found.means, found.means / found.gain)}
    curve = plots.curves([], lines, xlabel="signal over the dark [counts]", ylabel="variance over the dark's")
    yield Figure(curve, "The photon-transfer curve.")


def _result(title: str, about: str, thing: Any, quantities: list[Quantity], figures: Any) -> Result:
    width = max(len(one.label) for one in quantities)
    lines = tuple(f"{one.label:<{width}}  {one}" for one in quantities)
    return Result(title, about, thing, lines, tuple(quantities), figures)
