"""A camera drawn as a ray diagram."""

import math
from collections.abc import Iterable
from os import PathLike
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle

from lumigraph.core import upper_floors
from lumigraph.design.layout import Layout, LensletLayout, MicroscopeLayout
from lumigraph.errors import GeometryError
from lumigraph.plots import glass_layout, microscope_layout
from lumigraph.plots.axes import Drawing

MM = 1e3
AXIS_COLOUR, GLASS, DARK = "#8a8a8a", "#9ec9e2", "#333333"
KINDS = (GLASS, "#b9d8a5", "#e2b6c9")
BUNDLES = ("#c1272d", "#0071bc")
FAN = ("#7a4fa3", "#c1272d", "#e08a00", "#2e8b57", "#0071bc")


class DrawnCamera(Protocol):
    """Instruments that `layout` can draw."""

    def layout(self) -> Layout | MicroscopeLayout:
        """Distances and sizes of the instrument."""
        ...


def layout(camera: DrawnCamera | str | PathLike[str]) -> Figure:
    """Ray diagram of a camera: object, main lens with its stop, lenslets and sensor, distances labelled.

    The upper panel shows the whole camera, the lower one the lenslets and the sensor. Distances along the
    axis are to scale within a panel, heights are enlarged; the upper panel of a microscope is not to scale.
    Lenslets of several focal lengths have a colour for each, the stronger ones are thicker. A main lens of
    glass has a panel of its own, to scale.

    Parameters
    ----------
    camera
        Any camera or microscope of `lumigraph.instruments`, its file or its name in the catalogue.

    Raises
    ------
    GeometryError
        The object is inside the focal length, so that there are no rays to draw.

    Examples
    --------
    ``lumigraph.plots.layout(camera).savefig("layout.png")``
    """
    camera = upper_floors.camera(camera)
    drawn = camera.layout()
    if isinstance(drawn, MicroscopeLayout):
        return _microscope(drawn)
    if drawn.object_distance <= drawn.focal_length:
        raise GeometryError(
            f"the object at {drawn.object_distance * MM:.6g} mm is inside the focal length of "
            f"{drawn.focal_length * MM:.6g} mm: there is no image to draw. Move it farther away."
        )
    panels = [(1.0, lambda axes: _whole(axes, drawn))]
    if (glass := drawn.glass) is not None:
        panels.append((1.15, lambda axes: glass_layout.whole(axes, glass)))
    if (lenslets := drawn.lenslets) is not None:
        panels.append((1.15, lambda axes: _enlarged(axes, drawn, lenslets)))
    heights = [height for height, _ in panels]
    figure = Drawing(figsize=(9.0, 3.6 if len(panels) == 1 else 3.44 * sum(heights)), layout="constrained")
    every = figure.subplots(len(panels), 1, height_ratios=heights, squeeze=False)
    for axes, (_, draw) in zip(every[:, 0], panels, strict=True):
        draw(axes)
    return figure


def _microscope(drawn: MicroscopeLayout) -> Figure:
    """Objective to sensor, and the lenslets of one that stands near the native image."""
    if drawn.fourier_lens is not None:
        figure = Drawing(figsize=(9.0, 3.8), layout="constrained")
        microscope_layout.whole(figure.subplots(), drawn)
        return figure
    figure = Drawing(figsize=(9.0, 7.4), layout="constrained")
    upper, lower = figure.subplots(2, 1, height_ratios=(1.0, 1.15))
    microscope_layout.whole(upper, drawn)
    _enlarged(lower, drawn.behind, drawn.lenslets, "native image")
    return figure


def _whole(axes: Axes, drawn: Layout) -> None:
    """Object to sensor: one bundle from the axis, one from the field, chief rays dashed."""
    z1, length, radius = drawn.object_distance, drawn.separation, drawn.pupil_diameter / 2
    end, half_sensor = drawn.length, drawn.sensor_width / 2
    field = half_sensor * z1 / end
    top = max(field, 1.6 * radius, half_sensor)
    axes.plot([-z1 * MM, end * MM], [0, 0], color=AXIS_COLOUR, lw=0.8, ls="-.")
    for height, colour in zip((0.0, 0.75 * field), BUNDLES, strict=True):
        for u in (-radius, 0.0, radius):
            after = u + (-height * drawn.image_distance / z1 - u) / drawn.image_distance * length
            axes.plot(
                np.array([-z1, 0, length]) * MM, np.array([height, u, after]) * MM,
                color=colour, lw=1.0, ls="--" if u == 0 else "-",
            )  # fmt: skip
    width = 0.02 * (z1 + end)
    axes.add_patch(Ellipse((0, 0), width * MM, 2 * radius * MM, color=GLASS, zorder=3, alpha=0.8))
    for sign in (-1, 1):
        axes.plot(
            [0, 0], [sign * radius * MM, sign * 1.15 * top * MM], color=DARK, lw=3, solid_capstyle="butt"
        )
    _plane(axes, -z1, field, DARK)
    _plane(axes, end, half_sensor, DARK, lw=3.5)
    if drawn.lenslets is not None:
        _plane(axes, length, half_sensor, "#3b83ad", ls=(0, (1.2, 0.6)), lw=3)
    _name(axes, -z1, 1.25 * top, "object", "left")
    _name(axes, 0, 1.25 * top, f"main lens\nf = {_mm(drawn.focal_length)}", "center")
    close = end < 0.4 * z1  # the name would run into the main lens'
    behind = "sensor" if drawn.lenslets is None else "lenslets, sensor"
    _name(axes, end, (1.75 if close else 1.25) * top, behind, "right")
    _dimension(axes, (-z1, 0.0), -1.35 * top, f"z1 = {_mm(z1)}")
    symbol = "z2" if drawn.lenslets is None else _separation_name(drawn)
    _dimension(axes, (0.0, length), -1.35 * top, f"{symbol} = {_mm(length)}")
    axes.annotate(
        f"D = {_mm(2 * radius)}", (0, -radius * MM), (-0.25 * z1 * MM, -0.85 * top * MM), fontsize=9,
        ha="center", va="center", arrowprops={"arrowstyle": "-", "color": DARK, "lw": 0.7},
    )  # fmt: skip
    _frame(axes, (-1.04 * z1, end + 0.04 * z1), (-1.75 * top, 2.0 * top))


def _separation_name(drawn: Layout) -> str:
    return "F = z2" if math.isclose(drawn.separation, drawn.image_distance) else "L"


def _enlarged(axes: Axes, drawn: Layout, lenslets: LensletLayout, image: str = "main-lens image") -> None:
    """Five lenslets, the main-lens image and the sensor: rays of one or three image points."""
    pitch, b, length = lenslets.pitch, lenslets.distance, drawn.separation
    relay = length - drawn.image_distance
    shown = _lenslets_shown(drawn, lenslets.pitch)
    first, last = _range(relay, b)
    top = (shown / 2 + 0.25) * pitch * (1 + b / length)
    _rays(axes, (drawn, lenslets), first, shown)
    for k in _numbers(shown):
        height, width = 0.97 * pitch * MM, 0.035 * (last - first) * MM
        center, kind = lenslets.center(k) * MM, k % len(lenslets.focal_lengths)
        width *= _thickness(lenslets, kind)
        axes.add_patch(Ellipse((0, center), width, height, color=KINDS[kind % 3], zorder=3, alpha=0.85))
    _plane(axes, b, top, DARK, lw=3.5)
    _micro_images(axes, (drawn, lenslets), shown, last - first)
    if abs(relay) > 1e-9 * length:
        axes.plot([-relay * MM] * 2, [-top * MM, top * MM], color=DARK, lw=1.2, ls=":")
    _names(axes, relay, b, top, image if relay >= 0 else f"virtual {image}")
    if abs(relay) > 1e-9 * length:
        level = -1.25 if relay > 0 else -1.55
        _dimension(axes, tuple(sorted((-relay, 0.0))), level * top, f"a = {_mm(relay)}")
    _dimension(axes, (0.0, b), -1.25 * top, f"b = {_mm(b)}")
    directions = "direction" if image == "native image" else "place on the main lens"
    each = "lenslet" if abs(relay) > 1e-9 * length else directions
    caption = f"lenslets and sensor, enlarged; one colour for each {each}"
    if len(lenslets.focal_lengths) > 1:
        caption += "; lenslets of f = " + ", ".join(_mm(f) for f in lenslets.focal_lengths) + " in turn"
    axes.text(0.01, 0.0, caption, transform=axes.transAxes, fontsize=9, color=DARK, va="bottom")
    _frame(axes, (first, last), (-2.0 * top, 1.5 * top))


def _thickness(lenslets: LensletLayout, kind: int) -> float:
    """Thickness of a kind over the mean; its difference of power is drawn six times as large."""
    powers = [1 / abs(f) for f in lenslets.focal_lengths]
    middle = sum(powers) / len(powers)
    return min(max(1 + 6 * (powers[kind] / middle - 1), 0.5), 1.7)


def _lenslets_shown(drawn: Layout, pitch: float) -> int:
    """Enough lenslets for the light of one image point, odd like a count with one on the axis."""
    relay = abs(drawn.separation - drawn.image_distance)
    lit = drawn.pupil_diameter * relay / drawn.image_distance / pitch
    return int(min(max(5, 2 * math.ceil(lit / 2) + 3), 11))


def _range(relay: float, b: float) -> tuple[float, float]:
    """First and last distance from the lenslets to draw [m]."""
    if relay > 0:
        return -1.12 * relay, b + 0.12 * relay
    before = 1.2 * b if relay == 0 else 0.7 * max(b, abs(relay))
    return -before, max(1.35 * b, 1.08 * abs(relay))


def _numbers(shown: int) -> Iterable[int]:
    return range(-(shown // 2), shown // 2 + 1)


def _rays(axes: Axes, camera: tuple[Layout, LensletLayout], first: float, shown: int) -> None:
    """Rays of image points, coloured by lenslet (2.0) or by the place on the main lens (1.0)."""
    drawn, lenslets = camera
    z2, radius = drawn.image_distance, drawn.pupil_diameter / 2
    focused_on_lenslets = math.isclose(drawn.separation, z2)
    if focused_on_lenslets:
        # Light of the whole lenslet, from three places on the main lens: one pixel each.
        for k in (-1, 0, 1):
            for u, colour in zip((-0.92 * radius, 0.0, 0.92 * radius), FAN[1:], strict=False):
                for part in (-0.35, 0.0, 0.35):
                    _ray(axes, camera, first, (lenslets.center(k) + part * lenslets.pitch, u), colour)
        return
    for u in np.linspace(-0.97 * radius, 0.97 * radius, 4 * shown - 1):
        _ray(axes, camera, first, (lenslets.offset * z2 / drawn.separation, float(u)), None)


def _ray(
    axes: Axes,
    camera: tuple[Layout, LensletLayout],
    first: float,
    ends: tuple[float, float],
    colour: str | None,
) -> None:
    """Draw a ray from height u on the main lens towards the image point Y, through the nearest lenslet."""
    (drawn, lenslets), (image, u) = camera, ends
    slope = (image - u) / drawn.image_distance
    at_lenslets = u + slope * drawn.separation
    k, b = lenslets.nearest(at_lenslets), lenslets.distance
    after = slope - (at_lenslets - lenslets.center(k)) / lenslets.focal_length(k)
    colour = FAN[(k + 2) % len(FAN)] if colour is None else colour
    heights = np.array([at_lenslets + slope * first, at_lenslets, at_lenslets + after * b])
    axes.plot(np.array([first, 0, b]) * MM, heights * MM, color=colour, lw=0.9)
    relay = drawn.separation - drawn.image_distance
    if relay < 0:  # where the light would have gone
        axes.plot(
            np.array([0, -relay]) * MM, np.array([at_lenslets, image]) * MM, color=colour, lw=0.5, ls=":"
        )


def _micro_images(axes: Axes, camera: tuple[Layout, LensletLayout], shown: int, width: float) -> None:
    """Brackets behind the sensor: where each micro-image lies."""
    drawn, lenslets = camera
    b, length = lenslets.distance, drawn.separation
    half = drawn.pupil_diameter * b / length / 2
    by_lenslet = not math.isclose(length, drawn.image_distance)
    for k in _numbers(shown):
        center = lenslets.center(k) * (1 + b / length)
        corner = ((b + 0.012 * width) * MM, (center - half) * MM)
        face = FAN[(k + 2) % len(FAN)] if by_lenslet else AXIS_COLOUR
        axes.add_patch(Rectangle(corner, 0.012 * width * MM, 2 * half * MM, color=face, alpha=0.55, lw=0))


def _names(axes: Axes, relay: float, b: float, top: float, image: str) -> None:
    """Names above the planes; the nearest two never on one level."""
    if relay > 0:
        _name(axes, -relay, 1.12 * top, image, "center")
        _name(axes, 0, 1.12 * top, "lenslets", "center")
        _name(axes, b, 1.12 * top, "sensor, micro-images", "center")
    elif relay == 0:
        _name(axes, 0, 1.12 * top, f"lenslets at the {image}", "center")
        _name(axes, b, 1.12 * top, "sensor, micro-images", "center")
    else:
        _name(axes, 0, 1.12 * top, "lenslets", "right")
        _name(axes, b, 1.3 * top, "sensor, micro-images", "center")
        _name(axes, -relay, 1.12 * top, image, "right")


def _plane(axes: Axes, z: float, half: float, colour: str, **style: Any) -> None:
    axes.plot([z * MM] * 2, [-half * MM, half * MM], color=colour, **{"lw": 1.5, "zorder": 4, **style})


def _name(axes: Axes, z: float, height: float, text: str, align: str) -> None:
    axes.text(z * MM, height * MM, text, ha=align, va="bottom", fontsize=10, color=DARK)  # type: ignore[arg-type]


def _dimension(axes: Axes, ends: tuple[float, ...], height: float, text: str) -> None:
    """A double arrow with its text below."""
    left, right = ends[0] * MM, ends[-1] * MM
    axes.annotate(
        "", (left, height * MM), (right, height * MM),
        arrowprops={"arrowstyle": "<->", "color": DARK, "lw": 0.9, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    axes.annotate(
        text, ((left + right) / 2, height * MM), (0, -3), textcoords="offset points",
        ha="center", va="top", fontsize=9, color=DARK,
    )  # fmt: skip


def _frame(axes: Axes, z: tuple[float, float], y: tuple[float, float]) -> None:
    axes.set_xlim(z[0] * MM, z[1] * MM)
    axes.set_ylim(y[0] * MM, y[1] * MM)
    axes.set_axis_off()


def _mm(length: float) -> str:
    return f"{length * MM:.4g} mm"
