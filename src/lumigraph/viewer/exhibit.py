"""Contents of a page that shows one file."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.errors import LumigraphError
from lumigraph.instruments.capabilities import WithDepth
from lumigraph.rendering.focus_range import focus_range, focus_span

_WIDEST, _COMFORTABLE = 0.8, 0.5  # spans of refocus factors about 1


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """Pictures of one scene (n, y, x[, c]), each focused elsewhere.

    Parameters
    ----------
    data
        Pictures.
    positions
        One number each, ascending.
    label, unit
        What the numbers are, such as "Patch" and "px".
    """

    data: Array
    positions: tuple[float, ...]
    label: str = "Focus α′"
    unit: str = ""

    def __post_init__(self) -> None:
        checks.array("the planes", self.data)
        if len(self.data.shape) not in (3, 4) or len(self.positions) != self.data.shape[0]:
            raise LumigraphError(
                f"planes have shape {tuple(self.data.shape)} and {len(self.positions)} positions "
                "but must be (n, y, x[, c]) with a position each."
            )


@dataclass(frozen=True, slots=True, eq=False)
class Exhibit:
    """Contents of one page for one file; what is None is not shown.

    Parameters
    ----------
    name
        The file's name.
    views
        Light field: refocused, seen from other places, through other apertures.
    raw, calibration
        Raw image, and the lattice drawn over it.
    planes
        Focal stack, where there are no views.
    depth
        Depth map, or a function that computes it on demand.
    measure
        What the depths of that function are called, and their unit.
    volume
        Planes of space.
    facts
        (what, value) to show about the file.
    relative
        Whether the refocus factors have no meaning but the shift per view; see `comfortable`.
    metres
        Function from disparities of the views [lenslets or px] to depths from the focused plane [m]; None
        where the camera is not known.
    """

    name: str
    views: LightField | None = None
    raw: RawImage | None = None
    calibration: Calibration | None = None
    planes: Planes | None = None
    depth: DepthMap | Callable[[], DepthMap] | None = None
    measure: tuple[str, str] = ("Focus α′", "")
    volume: Volume | None = None
    facts: tuple[tuple[str, str], ...] = ()
    relative: bool = False
    metres: Callable[[np.ndarray], np.ndarray] | None = None

    def __post_init__(self) -> None:
        if all(part is None for part in (self.views, self.raw, self.planes, self.volume)):
            raise LumigraphError(f"{self.name} has nothing to show: no views, raw image, stack or volume.")
        for part in (self.views, self.raw, self.volume):
            if part is not None:
                check_shown(self.name, part)


def check_shown(name: str, part: Any) -> None:
    """Refuse colours other than grey and RGB, and numbers that no screen shows."""
    data, axes = part.data, {LightField: 4, RawImage: 2, Volume: 3}.get(type(part), 3)
    channels = tuple(data.shape[axes:])
    if channels not in ((), (1,), (3,)):
        raise LumigraphError(f"{name} has {channels[0]} channels but grey or RGB can be shown. Choose three.")


def comfortable(views: LightField) -> tuple[LightField, bool]:
    """The light field with refocus factors well above 0, and whether its lengths were changed for it.

    Cameras side by side see disparities of several pixels per view: refocus factors about one spacing of
    cameras for one pixel would fall below 0, which no lens can do. Counting pixels as smaller keeps every
    picture and brings the factors of all of them near 1.
    """
    span = focus_span(views)
    if span <= _WIDEST:
        return views, False
    times, grid = span / _COMFORTABLE, views.lenslets
    smaller = Grid(
        grid.shape, (grid.pitch[0] / times, grid.pitch[1] / times),
        (grid.center[0] / times, grid.center[1] / times),
    )  # fmt: skip
    return LightField(views.data, views.aperture, smaller, views.separation, views.valid), True


def focal_stack(views: LightField, count: int = 33) -> Planes:
    """Pictures focused through the whole range, by `lumigraph.refocus_stack`."""
    from lumigraph.rendering import refocus_stack

    alphas = np.linspace(*focus_range(views), count)
    data = refocus_stack(grey_or_colour(views), alphas)
    return Planes(data, tuple(float(alpha) for alpha in alphas))


def depth_of(views: LightField) -> Callable[[], DepthMap] | None:
    """Function that measures refocus factors of the middle view on demand, as `lumigraph depth` does.

    None where there is nothing to measure: one view, or views that are too small.
    """
    from lumigraph.depth import alpha_of, epi
    from lumigraph.depth.pictures import measurable

    return (lambda: alpha_of(epi(grey_or_colour(views)), views)) if measurable(views) else None


def object_depths(
    views: LightField, metres: Callable[[np.ndarray], np.ndarray], count: int = 513
) -> tuple[list[float], list[float]]:
    """Refocus factors that have an object, and its depths from the focused plane [m].

    They reach farther than the slider, as measured depths do.
    """
    from lumigraph.depth import disparity_of

    low, high = focus_range(views)
    alphas = np.linspace(2 * low - high, 2 * high - low, count)[None]
    depths = metres(to_numpy(disparity_of(DepthMap(alphas, np.ones(alphas.shape), "alpha"), views).values))
    known = np.isfinite(depths)
    return alphas[known].tolist(), depths[known].tolist()


def depth_of_pixels(
    raw: RawImage, calibration: Calibration, focus: list[float] | None, camera: WithDepth | None
) -> DepthMap:
    """Depth of each pixel of a camera 2.0's picture, as `lumigraph depth` measures it.

    Depths from the focused plane [m] where the camera's description is known, else patches [px].
    """
    from lumigraph.depth import of_pixels

    found = of_pixels(raw, calibration, focus=focus).depth
    return found if camera is None else camera.in_metres(found, calibration)


def grey_or_colour(views: LightField) -> LightField:
    """The light field without a colour axis of one channel."""
    if len(views.data.shape) == 5 and views.data.shape[4] == 1:
        return LightField(
            views.data[..., 0], views.aperture, views.lenslets, views.separation, views.valid
        )  # fmt: skip
    return views
