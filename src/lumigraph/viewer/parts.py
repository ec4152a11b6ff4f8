"""An exhibit as a description (JSON) and arrays that are sent on request."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.rendering import all_in_focus, detail
from lumigraph.rendering.geometry import lit
from lumigraph.viewer.encoding import Coded, white_level
from lumigraph.viewer.exhibit import (
    Exhibit,
    Planes,
    focal_stack,
    focus_range,
    grey_or_colour,
    object_depths,
)
from lumigraph.viewer.start import poster, subject_focus

CHUNK = 8 << 20
"""Bytes of views sent at a time, so that a picture can be shown before all have come."""

_LARGEST_LENSLET = 0.01  # [m]: light fields whose lengths are not known count in lenslets of 1

_MOST_CENTERS = 20_000


@dataclass(slots=True)
class Parts:
    """Description of an exhibit, and its arrays by name.

    Parameters
    ----------
    about
        What the page must know, as JSON can hold it.
    arrays
        Functions that give an array's numbers; called late, because some are computed.
    written
        Whether the page is written into files, with the picture that it opens with.
    """

    about: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, Callable[[], Coded]] = field(default_factory=dict)
    written: bool = False

    @classmethod
    def of(cls, exhibit: Exhibit, *, written: bool = False) -> "Parts":
        """All parts of an exhibit."""
        facts = [list(fact) for fact in exhibit.facts]
        parts = cls({"name": exhibit.name, "facts": facts}, written=written)
        parts._add_views(exhibit)
        parts._add_raw(exhibit)
        parts._add_planes(exhibit)
        parts._add_volume(exhibit)
        parts._add_depth(exhibit)
        return parts

    def _add_views(self, exhibit: Exhibit) -> None:
        if exhibit.views is None:
            return
        views = grey_or_colour(exhibit.views)
        coded, data = Coded.of(views.data), to_numpy(views.data)
        low, high = focus_range(views)
        start, white = subject_focus(views), white_level(data)
        self.about["views"] = {
            "shape": list(data.shape[:4]),
            "channels": 3 if data.ndim == 5 else 1,
            "bits": coded.bits,
            "white": white,
            "aperture": _grid(views.aperture),
            "lenslets": _grid(views.lenslets),
            "separation": views.separation,
            "relative": exhibit.relative,
            "metric": not exhibit.relative and max(views.lenslets.pitch) < _LARGEST_LENSLET,
            "lit": "".join("1" if on else "0" for on in lit(views.data).ravel()),
            "focus": [low, high],
            "start": start,
            "poster": self.written,
            "detail": detail(views),
            "masked": views.valid is not None,
            "chunks": _chunks(data.shape, coded.numbers.itemsize),
        }
        self.arrays["views"] = lambda: coded
        if self.written:
            self.arrays["poster"] = lambda: poster(views, start, detail(views), white)
        if views.valid is not None:
            self.arrays["valid"] = lambda: Coded.of(to_numpy(views.valid) > 0)

    def _add_raw(self, exhibit: Exhibit) -> None:
        if exhibit.raw is None:
            return
        raw = exhibit.raw
        data = to_numpy(raw.data)
        data = data[..., 0] if data.ndim == 3 and data.shape[2] == 1 else data
        self.about["raw"] = {
            "white": white_level(data, raw.bit_depth),
            "pitch": raw.pixel_pitch,
            "bayer": raw.bayer,
        }
        if exhibit.calibration is not None:
            lattice = exhibit.calibration.lattice
            self.about["raw"]["lattice"] = {
                "basis": [list(vector) for vector in lattice.basis], "origin": list(lattice.origin),
                "layout": lattice.layout, "kinds": lattice.kinds, "pitch": lattice.pitch,
            }  # fmt: skip
            self.about["raw"]["lattice"] |= _bent(exhibit.calibration)
        self.arrays["raw"] = lambda: Coded.of(data)

    def _add_planes(self, exhibit: Exhibit) -> None:
        planes, views = exhibit.planes, exhibit.views
        if isinstance(planes, Planes):
            self.about["stack"] = {
                "positions": list(planes.positions), "label": planes.label, "unit": planes.unit,
                "white": white_level(planes.data),
            }  # fmt: skip
            self.arrays["stack"] = lambda: Coded.of(planes.data)
        elif views is not None:  # what a page without WebGL, or with a slow one, shows while focus moves
            self.about["stack"] = {
                "positions": np.linspace(*focus_range(views), 33).tolist(), "label": "Focus α′", "unit": "",
                "white": self.about["views"]["white"], "fallback": True,
            }  # fmt: skip
            self.arrays["stack"] = lambda: Coded.of(focal_stack(views).data)

    def _add_volume(self, exhibit: Exhibit) -> None:
        if exhibit.volume is None:
            return
        volume = exhibit.volume
        data = to_numpy(volume.data)
        data = data[..., 0] if data.ndim == 4 and data.shape[3] == 1 else data
        self.about["volume"] = {
            "depths": list(volume.depths), "grid": _grid(volume.grid), "spacing": list(volume.spacing),
            "white": white_level(data),
        }  # fmt: skip
        self.arrays["volume"] = lambda: Coded.of(data)

    def _add_depth(self, exhibit: Exhibit) -> None:
        depth = exhibit.depth
        if depth is None:
            return
        found: list[Any] = []

        def once() -> Any:
            if not found:
                found.append(depth() if callable(depth) else depth)
            return found[0]

        label, unit = exhibit.measure
        if isinstance(depth, DepthMap) and depth.quantity != "alpha":
            label, unit = depth.quantity.capitalize(), depth.unit
        told = callable(depth) or depth.error is not None  # what computes it tells it
        self.about["depth"] = {"label": label, "unit": unit, "error": told}
        if told:
            self.arrays["error"] = lambda: Coded.of(_expected(once()))
        if (views := exhibit.views) is not None:
            self.about["sharp"] = True
            if exhibit.metres is not None:
                self.about["depth"]["metres"] = object_depths(views, exhibit.metres)
            self.arrays["sharp"] = lambda: Coded.of(_sharp(views, once()))
        self.arrays["depth"] = lambda: Coded.of(_finite(to_numpy(once().values)))
        self.arrays["confidence"] = lambda: Coded.of(
            np.rint(255 * np.clip(_trusted(once()), 0, 1)).astype(np.uint8)
        )


def _sharp(views: LightField, depth: Any) -> np.ndarray:
    """Every place focused on what is there, by its refocus factor; no lens has one of 0 or less."""
    known = (_trusted(depth) > 0) & (to_numpy(depth.values) > 0)
    factors = np.where(known, to_numpy(depth.values), np.nan)
    factors = factors if np.isfinite(factors).any() else np.ones(factors.shape)
    return to_numpy(all_in_focus(grey_or_colour(views), depth=factors, oversample=1).picture)


def _trusted(depth: Any) -> np.ndarray:
    """Confidence, 0 where the depth is not known."""
    return np.where(np.isfinite(to_numpy(depth.values)), np.nan_to_num(to_numpy(depth.confidence)), 0.0)


def _expected(depth: Any) -> np.ndarray:
    """Expected errors, 0 where none is known."""
    error = np.zeros(depth.shape) if depth.error is None else to_numpy(depth.error)
    return np.nan_to_num(error, posinf=0.0)


def _finite(values: np.ndarray) -> np.ndarray:
    """Values with those not known set to the median, so that they do not stretch the range."""
    known = values[np.isfinite(values)]
    return np.where(np.isfinite(values), values, np.median(known) if known.size else 0.0)


def _bent(calibration: Calibration) -> dict[str, Any]:
    """Centres and kinds of a lattice that is not straight, which the page cannot work out itself."""
    if calibration.warp is None and calibration.aside is None:
        return {}
    ny, nx = calibration.shape
    indices = calibration.indices_within((0, ny - 1), (0, nx - 1))[:_MOST_CENTERS]
    kinds = calibration.lattice.kind(*indices.T)
    return {"centers": np.round(calibration.position(indices), 2).tolist(), "kindOf": kinds.tolist()}


def _grid(grid: Grid) -> dict[str, list[float]]:
    return {"pitch": list(grid.pitch), "center": list(grid.center), "shape": list(grid.shape)}


def _chunks(shape: tuple[int, ...], itemsize: int) -> list[list[int]]:
    """(first view, how many) of what is sent at a time: the middle view alone, then all in their order."""
    count, size = shape[0] * shape[1], int(np.prod(shape[2:])) * itemsize
    middle = (shape[0] // 2) * shape[1] + shape[1] // 2
    step = max(1, CHUNK // max(size, 1))
    return [[middle, 1], *([k, min(step, count - k)] for k in range(0, count, step))]
