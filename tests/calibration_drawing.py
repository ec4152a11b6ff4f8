"""White images drawn from their definition: micro-images with the area of each pixel that they cover."""

import math

import numpy as np

from lumigraph.core.lattice import Lattice

_ROWS = 12  # lines through a pixel; along each line the covered length is exact


def drawn(centers, shape, size, form="disc", turn=0.0, light=1.0):
    """Picture of discs of diameter `size`, or squares of that side turned by `turn` [rad], added up."""
    reach = int(np.ceil(size / 2 * (1 if form == "disc" else 1.45))) + 2
    ny, nx = shape
    pad = 2 * reach + 1
    picture = np.zeros((ny + 2 * pad, nx + 2 * pad))
    keep = ((centers > -reach) & (centers < np.array(shape) + reach - 1)).all(-1)
    light = np.broadcast_to(light, len(centers))[keep]
    for chunk in np.array_split(np.arange(keep.sum()), max(1, keep.sum() * reach**2 // 200000)):
        middle = centers[keep][chunk]
        first = np.rint(middle).astype(int)
        steps = np.arange(-reach, reach + 1)
        lines = (np.arange(_ROWS) + 0.5) / _ROWS - 0.5
        y = (steps[:, None] + lines).ravel() - (middle - first)[:, :1]
        low, high = _span(y, size, form, turn)
        left = steps - 0.5 - (middle - first)[:, 1:]
        covered = np.minimum(high[..., None], left[:, None, :] + 1) - np.maximum(
            low[..., None], left[:, None]
        )
        area = np.maximum(covered, 0).reshape(len(middle), len(steps), _ROWS, len(steps)).mean(2)
        rows, columns = first[:, :1] + steps + pad, first[:, 1:] + steps + pad
        np.add.at(picture, (rows[:, :, None], columns[:, None, :]), area * light[chunk, None, None])
    return picture[pad : pad + ny, pad : pad + nx]


def _span(y, size, form, turn):
    """From where to where each line at height y runs inside the shape; high < low where it misses."""
    half = size / 2
    if form == "disc":
        x = np.sqrt(np.maximum(half**2 - y**2, 0))
        return -x, np.where(np.abs(y) < half, x, -x)
    # |x cos + y sin| <= half and |y cos - x sin| <= half
    cos, sin = np.cos(turn), np.sin(turn)
    low, high = (-half - y * sin) / cos, (half - y * sin) / cos
    if abs(sin) > 1e-9:
        a, b = (y * cos - half) / sin, (y * cos + half) / sin
        low, high = np.maximum(low, np.minimum(a, b)), np.minimum(high, np.maximum(a, b))
    else:
        high = np.where(np.abs(y * cos) <= half, high, low)
    return low, high


def white(lattice, shape, *, fill=0.9, form="disc", warp=None, dead=0.0, noise=0.0, vignetting=0.0, rng=None):
    """White image of a lattice and the true centres on it; noise is a part of the root mean square signal."""
    margin = 2 * lattice.pitch + 60
    points = lattice.centers((-margin, shape[0] + margin), (-margin, shape[1] + margin))
    centers = points if warp is None else warp.applied(points)
    light = np.ones(len(centers))
    if dead:
        light[rng.random(len(centers)) < dead] = 0
    picture = drawn(centers, shape, fill * lattice.pitch, form, lattice.rotation, light)
    y, x = np.linspace(-1, 1, shape[0])[:, None], np.linspace(-1, 1, shape[1])
    picture = picture * (1 - vignetting * (y**2 + x**2) / 2)
    if noise:
        picture = picture + noise * np.sqrt(np.mean(picture**2)) * rng.standard_normal(shape)
    on = ((centers >= 0) & (centers <= np.array(shape) - 1)).all(-1)
    return picture, centers[on]


def random_case(rng, smallest=5.0, largest=200.0):
    """A random lattice and how to draw it: (lattice, shape, options)."""
    layout = ["square", "hex"][rng.integers(2)]
    pitch = float(np.exp(rng.uniform(np.log(smallest), np.log(largest))))
    turn = rng.uniform(-0.035, 0.035) if rng.random() < 0.7 else rng.uniform(-np.pi / 4, np.pi / 4)
    lattice = getattr(Lattice, layout)(pitch, turn, tuple(rng.uniform(0, pitch, 2)))
    form = "disc" if layout == "hex" else ["disc", "square"][rng.integers(2)]
    across = rng.uniform(6, 14 if pitch > 60 else 40)
    shape = tuple(int(max(48, min(1000, across * pitch * rng.uniform(0.8, 1.2)))) for _ in range(2))
    shape = tuple(max(n, int(5.2 * pitch)) for n in shape)
    thin = max(0.45, 1 - 1.2 / pitch) if form == "square" else 1.0  # a gap of squares: what pixels can show
    options = {
        "fill": float(rng.uniform(0.4, thin)), "form": form, "vignetting": float(rng.uniform(0, 0.6)),
        "noise": float(rng.choice([0, 0.03, 0.1])), "dead": float(rng.choice([0, 0.01, 0.03])),
    }  # fmt: skip
    return lattice, shape, options


def sampled(lattice, shape, form="round", fill=0.9, over=4):
    """White image: area fraction of each pixel inside micro-images, from over² points a pixel."""
    inside = np.zeros(shape)
    cos, sin = math.cos(lattice.rotation), math.sin(lattice.rotation)
    steps = (np.arange(over) - (over - 1) / 2) / over
    radius = fill * lattice.pitch / 2
    for a in steps:
        for b in steps:
            dy, dx = lattice.offset(np.arange(shape[0])[:, None] + a, np.arange(shape[1])[None, :] + b)
            if form == "round":
                inside += np.hypot(dy, dx) < radius
            elif form == "square":
                inside += np.maximum(np.abs(dy * cos - dx * sin), np.abs(dx * cos + dy * sin)) < radius
            else:
                r = np.hypot(dy, dx) / lattice.pitch
                inside += (1 + np.cos(2 * np.pi * r * 5)) * (r < fill / 2)  # bright ring at the edge
    return inside / over**2
