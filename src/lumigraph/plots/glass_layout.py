"""A main lens of glass drawn to scale, with rays through its surfaces."""

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from lumigraph.design.layout import GlassLayout

MM = 1e3
COLOURS, GLASS, DARK, AXIS = ("#c1272d", "#0071bc"), "#9ec9e2", "#333333", "#8a8a8a"

BESIDE = 0.25
"""Length shown before and behind the lens, over the lens'."""


def whole(axes: Axes, drawn: GlassLayout) -> None:
    """Surfaces as far as light reaches, stop and principal planes, and bundles from two fields."""
    surfaces, top = drawn.surfaces * MM, float(drawn.half_heights.max()) * MM
    planes = [plane * MM for plane in drawn.planes]
    low, high = min(surfaces[:, 0].min(), *planes), max(surfaces[:, 0].max(), *planes)
    ends = low - BESIDE * (high - low), high + BESIDE * (high - low)
    axes.plot(ends, [0, 0], color=AXIS, lw=0.8, ls="-.")
    for k, (one, other) in enumerate(pairwise(surfaces)):
        if drawn.is_glass[k]:
            edge = np.concatenate((one, other[:, ::-1]), axis=1)
            axes.fill(*edge, facecolor=GLASS, edgecolor="#3b83ad", lw=0.9, alpha=0.75, zorder=2)
    _rays(axes, drawn)
    stop, half = surfaces[drawn.stop, 0].mean(), drawn.half_heights[drawn.stop] * MM
    for sign in (-1, 1):
        axes.plot(
            [stop] * 2, [sign * half, sign * 1.25 * top], color=DARK, lw=3, solid_capstyle="butt", zorder=3
        )
    for plane, name, level in zip(planes, ("H", "H\u2032"), (1.3, 1.3), strict=True):
        axes.plot([plane] * 2, [-1.2 * top, 1.2 * top], color=DARK, lw=0.9, ls=":")
        axes.text(plane, level * top, name, ha="center", va="bottom", fontsize=9, color=DARK)
    axes.text(stop, -1.32 * top, "stop", ha="center", va="top", fontsize=9, color=DARK)
    axes.set_xlim(*ends)
    axes.set_ylim(-1.75 * top, 1.75 * top)
    axes.set_aspect("equal")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_xlabel("behind the first surface [mm]", fontsize=9)
    axes.set_ylabel("height [mm]", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.set_title(
        "main lens, to scale: surfaces as far as light reaches, principal planes H and H\u2032",
        fontsize=9, color=DARK, loc="left",
    )  # fmt: skip


def _rays(axes: Axes, drawn: GlassLayout) -> None:
    """A colour for each field, the chief rays dashed."""
    for bundle, colour in zip(np.split(drawn.rays * MM, 2), COLOURS, strict=True):
        for k, (z, height) in enumerate(bundle):
            axes.plot(z, height, color=colour, lw=0.8, ls="--" if 2 * k + 1 == len(bundle) else "-", zorder=4)
