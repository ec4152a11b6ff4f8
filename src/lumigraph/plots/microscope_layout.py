"""A light-field microscope drawn with its rays.

Nothing is to scale: focal lengths are 1 for the objective, 2 for the tube lens and 1.5 for a Fourier lens.
But every ray is refracted as by thin lenses, so that rays meet where they should.
"""

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from lumigraph.design.layout import MicroscopeLayout
from lumigraph.plots.axes import length_unit

OBJECTIVE, TUBE, FOURIER, LENSLET = 1.0, 2.0, 1.5, 0.45
APERTURE, FIELD = 0.55, 0.12
"""Steepest slope from the object, and height of the point beside the axis."""
COLOURS, GLASS, DARK = ("#c1272d", "#0071bc"), "#9ec9e2", "#333333"

Plane = tuple[float, float, str]
"""Place along the axis, focal length (infinite without glass), name."""


def planes(drawn: MicroscopeLayout) -> list[Plane]:
    """Planes from the object to the lenslets: position, focal length, name."""
    image = 2 * OBJECTIVE + 2 * TUBE
    tube = f"tube lens\nf = {_length(drawn.tube_lens)}" if drawn.tube_lens else "tube lens"
    found = [
        (0.0, np.inf, "object"),
        (OBJECTIVE, OBJECTIVE, f"objective\n{drawn.magnification:.4g}x / {drawn.numerical_aperture:.3g}"),
        (2 * OBJECTIVE, np.inf, "pupil"),
        (2 * OBJECTIVE + TUBE, TUBE, tube),
    ]
    if drawn.fourier_lens is None:
        return [*found, (image, np.inf, "native image\nand lenslets" if not drawn.offset else "native image")]
    lens = f"Fourier lens\nf = {_length(drawn.fourier_lens)}"
    return [
        *found, (image, np.inf, "native image"), (image + FOURIER, FOURIER, lens),
        (image + 2 * FOURIER, np.inf, "lenslets"),
    ]  # fmt: skip


def whole(axes: Axes, drawn: MicroscopeLayout) -> None:
    """Object to sensor: a bundle from the axis and one from beside it, chief rays dashed."""
    stations = planes(drawn)
    end = stations[-1][0] + LENSLET
    axes.plot([-0.1, end], [0, 0], color="#8a8a8a", lw=0.8, ls="-.")
    for height, colour in zip((0.0, FIELD), COLOURS, strict=True):
        for slope in (-APERTURE, 0.0, APERTURE):
            across = traced(stations, height, slope)
            axes.plot(
                [z for z, _, _ in stations], across, color=colour, lw=1.0, ls="--" if slope == 0 else "-"
            )
    half = 1.25 * APERTURE
    for number, (z, focal_length, name) in enumerate(stations):
        if np.isfinite(focal_length):
            axes.add_patch(Ellipse((z, 0), 0.14, 2.3 * half, color=GLASS, zorder=3, alpha=0.85))
        elif name == "pupil":
            for sign in (-1, 1):
                axes.plot(
                    [z, z], [sign * APERTURE, sign * 1.4 * half], color=DARK, lw=3, solid_capstyle="butt"
                )
        else:
            axes.plot([z, z], [-half, half], color=DARK, lw=1.2, ls=":")
        level = 1.75 if number % 2 == 0 else 1.25
        axes.text(z, level * half, name, ha="center", va="bottom", fontsize=10, color=DARK)
    _array(axes, stations[-1][0] + 0.12 * np.sign(drawn.offset), half)
    axes.plot([end, end], [-half, half], color=DARK, lw=3.5)
    axes.text(end, -1.25 * half, "sensor", ha="center", va="top", fontsize=10, color=DARK)
    axes.set_xlim(-0.5, end + 0.5)
    axes.set_ylim(-1.7 * half, 2.6 * half)
    axes.set_axis_off()


def traced(stations: list[Plane], height: float, slope: float) -> list[float]:
    """Heights of a ray at each plane, refracted by thin lenses."""
    found = [height]
    for (before, _, _), (z, focal_length, _) in pairwise(stations):
        height += slope * (z - before)
        slope -= height / focal_length
        found.append(height)
    return found


def _array(axes: Axes, z: float, half: float) -> None:
    """Five lenslets."""
    for center in np.linspace(-0.8, 0.8, 5) * half:
        axes.add_patch(Ellipse((z, center), 0.09, 0.38 * half, color=GLASS, zorder=3, alpha=0.95))


def _length(value: float) -> str:
    unit, name = length_unit(value)
    return f"{value / unit:.4g} {name}"
