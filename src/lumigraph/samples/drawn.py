"""Randomly drawn scenes before a camera, with the truth, to train and test learned methods."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError
from lumigraph.sensor import Sensor

LAYOUTS = ("patches", "slanted", "beads")
"""Patches at depths of their own, side by side; one slanted plane, in steps; beads in a dark volume."""

TEXTURES = ("noise", "blobs", "stripes", "photograph")
"""Textures of patches and planes; photographs where some are given."""

FILLS = (0.3, 0.9)
"""Part of a full well that the brightest pixel fills, from and to."""

_LEAST = 0.05
"""Least intensity of a texture, of its highest."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnSample:
    """A raw image and what it shows.

    Parameters
    ----------
    raw
        The exposure.
    intensity
        Intensity of the scene's planes (z, y, x), float32 from 0 to 1.
    depth
        Depth of each place (y, x) from the focused plane [m]; None of beads, which have no single one.
    drawn
        Random values, by name.
    """

    raw: RawImage
    intensity: np.ndarray
    depth: np.ndarray | None
    drawn: dict[str, float] = field(default_factory=dict)

    @property
    def picture(self) -> np.ndarray:
        """All planes in focus (y, x)."""
        return self.intensity.sum(0)


def drawn(
    operator: Linear,
    sensor: Sensor,
    rng: np.random.Generator,
    *,
    layouts: Sequence[str] = LAYOUTS[:2],
    photographs: Sequence[np.ndarray] = (),
) -> DrawnSample:
    """One randomly drawn scene before a camera, with photon and read noise.

    Light adds up: where patches meet, the near one hides nothing of what is behind it.

    Parameters
    ----------
    operator
        ``camera.operator(depths)``; scenes stand at its depths.
    sensor
        ``camera.sensor``.
    rng
        Source of random numbers: the same state draws the same sample.
    layouts
        Layouts, of `LAYOUTS`; one of them is drawn.
    photographs
        (y, x) or (y, x, c), of which parts become textures, in grey.

    Raises
    ------
    GeometryError
        An operator without depths, or no such layout.
    """
    if operator.depths is None:
        raise GeometryError("the operator has one plane. Give camera.operator(depths) of several.")
    if not layouts:
        raise GeometryError("there are no layouts. Give some of " + ", ".join(LAYOUTS) + ".")
    for layout in layouts:
        checks.choice("a layout", layout, LAYOUTS)
    shape, depths = operator.shape[1], np.asarray(operator.depths)
    layout = layouts[int(rng.integers(len(layouts)))]
    told = {"layout": float(LAYOUTS.index(layout)), "fill": float(rng.uniform(*FILLS))}
    depth = None
    if layout == "beads":
        intensity = _beads(shape, rng)
    else:
        planes = _patches(shape, rng) if layout == "patches" else _slanted(shape, rng)
        texture, told["texture"] = _texture(shape[1:], rng, photographs)
        intensity = np.where(np.arange(shape[0])[:, None, None] == planes, texture, 0)
        depth = depths[planes].astype(np.float32)
    intensity = intensity.astype(np.float32)
    light = np.maximum(to_numpy(operator.forward(intensity)), 0)
    raw = sensor.expose(light, fill=told["fill"], rng=rng)
    return DrawnSample(raw, intensity, depth, told)


def _patches(shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Number of the plane (y, x): wavy regions around some points, each at one of the depths."""
    count, (ny, nx) = int(rng.integers(2, 6)), shape[1:]
    y, x = np.mgrid[:ny, :nx] / max(ny, nx)
    y, x = (place + 0.08 * _smooth((ny, nx), 0.1 * max(ny, nx), rng) for place in (y, x))
    points = rng.random((count, 2)) * (ny, nx) / max(ny, nx)
    nearest = np.argmin([(y - a) ** 2 + (x - b) ** 2 for a, b in points], axis=0)
    return rng.integers(shape[0], size=count)[nearest]


def _slanted(shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Number of the plane (y, x) of a plane that rises from one depth to another, in steps."""
    angle, (low, high) = rng.uniform(0, 2 * np.pi), np.sort(rng.uniform(-0.5, shape[0] - 0.5, 2))
    y, x = (np.linspace(-1, 1, n) for n in shape[1:])
    rise = np.sin(angle) * y[:, None] + np.cos(angle) * x
    rise = (rise - rise.min()) / max(np.ptp(rise), 1e-9)
    return np.clip(np.rint(low + (high - low) * rise), 0, shape[0] - 1).astype(int)


def _beads(shape: tuple[int, ...], rng: np.random.Generator) -> np.ndarray:
    """Bright beads of some samples' width (z, y, x), one in a thousand samples or fewer."""
    volume = np.zeros(shape)
    count = max(1, int(rng.uniform(0.05, 1) * 1e-3 * volume.size))
    places = tuple(rng.integers(n, size=count) for n in shape)
    volume[places] = rng.uniform(0.2, 1, count)
    width = rng.uniform(0, 1.5)
    volume = gaussian_filter(volume, (0, width, width)) if width > 0.3 else volume
    return volume / volume.max()


def _texture(
    shape: tuple[int, ...], rng: np.random.Generator, photographs: Sequence[np.ndarray]
) -> tuple[np.ndarray, float]:
    """A texture (y, x) from `_LEAST` to 1, and its number in `TEXTURES`."""
    kind = int(rng.integers(len(TEXTURES) - (not len(photographs))))
    ny, nx = shape
    if TEXTURES[kind] == "noise":
        values = sum(_smooth((ny, nx), width, rng) for width in 1.5 * 2.0 ** np.arange(1 + rng.integers(5)))
    elif TEXTURES[kind] == "blobs":
        values = (_smooth((ny, nx), rng.uniform(1.5, 6), rng) > rng.uniform(0, 1.5)) * 1.0
    elif TEXTURES[kind] == "stripes":
        y, x = np.mgrid[:ny, :nx]
        turn, period = rng.uniform(0, np.pi), rng.uniform(6, 30)
        values = np.cos(2 * np.pi * (np.sin(turn) * y + np.cos(turn) * x) / period)
        values = values + 0.5 * _smooth((ny, nx), 4, rng)
    else:
        values = _part(photographs[int(rng.integers(len(photographs)))], (ny, nx), rng)
    low, high = np.min(values), np.max(values)
    return _LEAST + (1 - _LEAST) * (values - low) / max(high - low, 1e-12), float(kind)


def _smooth(shape: tuple[int, int], width: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of mean 0 and variance 1, even over `width` samples."""
    values = gaussian_filter(rng.standard_normal(shape), width, mode="wrap")
    return values / max(float(values.std()), 1e-12)


def _part(photograph: np.ndarray, shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """A part of a photograph in grey, at least half as large, turned or not, resampled."""
    grey = np.asarray(photograph, np.float32)
    grey = grey.mean(2) if grey.ndim == 3 else grey
    share = min(n / m for n, m in zip(grey.shape, shape, strict=True)) * rng.uniform(0.5, 1)
    sizes = [max(2, min(n, round(share * m))) for n, m in zip(grey.shape, shape, strict=True)]
    first = [int(rng.integers(n - size + 1)) for n, size in zip(grey.shape, sizes, strict=True)]
    part = grey[first[0] : first[0] + sizes[0], first[1] : first[1] + sizes[1]]
    factors = [m / size for m, size in zip(shape, sizes, strict=True)]
    part = gaussian_filter(part, [max(0.0, (1 / factor - 1) / 2) for factor in factors], mode="mirror")
    found = np.asarray(zoom(part, factors, order=1, mode="mirror", grid_mode=True))
    return found[:, ::-1] if rng.random() < 0.5 else found
