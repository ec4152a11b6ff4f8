"""Depth of pixels of drawn plenoptic 2.0 pictures (`lg.depth.dense`): errors, and those expected.

Three cameras (one kind of lenslets, three kinds, Galilean) before a disc and a plane, a bent surface, a
slanted one, and steps; then pictures that hold no depth, or not one. With --factors it compares the factors
in use, `lumigraph.depth.expected.MICRO_IMAGES`, with those of the greatest likelihood of the scenes in
`FITTED`. Those in use are less for noise, which a surface without bends averages over more places.

    python -m benchmarks.pixel_depth [camera or case ...]
    python -m benchmarks.pixel_depth --factors
"""

import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks.depth import show
from benchmarks.expected import Parts
from benchmarks.expected import show as show_factors
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.depth.dense import moves_of
from lumigraph.depth.expected import MICRO_IMAGES, terms
from lumigraph.depth.flat import FlatImage
from lumigraph.depth.sightings import Sightings
from lumigraph.rendering.patches import Patches, PatchLayout, checked_focus

Surface = tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any] | None]
"""Texture, patch [px] and, but for the farthest, mask: functions of (y, x) in the plane of the lattice."""

SHAPE = 150, 170
CAMERAS = {
    "square": (Lattice.square(21.3, 0.01, (10, 10)), [6.0]),
    "three kinds": (Lattice.hex(21.3, 0.0, (10, 10), kinds=3), [4.7, 6.0, 7.3]),
    "Galilean": (Lattice.square(21.3, 0.0, (10, 10)), [-6.0]),
}
NOISE = 0.01, 0.05
FITTED = ("square, bent, 0.01", "three kinds, steps, 0.01")


def texture(rng, waves=40, longest=0.9):
    """A function of (y, x): a sum of waves of up to `longest` radians per sample, from 0 to 2 or so."""
    ky, kx = rng.uniform(-longest, longest, (2, waves))
    phase = rng.uniform(0, 2 * np.pi, waves)

    def at(y, x):
        total = np.zeros(np.broadcast(y, x).shape)
        for a, b, c in zip(ky, kx, phase, strict=True):
            total += np.cos(a * y + b * x + c)
        return 1 + 0.9 * total / np.sqrt(waves)

    return at


def disc(y: Any, x: Any) -> Any:
    """A patch of 7 px before one of 5 px."""
    return np.where(np.hypot(y - 75, x - 85) < 42, 7.0, 5.0)


def bent(y: Any, x: Any) -> Any:
    """Waves of 0.8 px."""
    return 6.0 + 0.8 * np.sin(x / 18) * np.cos(y / 25)


def slant(y: Any, x: Any) -> Any:
    """From 5 to 7 px or so."""
    return 6.0 + (x - 85) * 0.012 + (y - 75) * 0.004


def steps(y: Any, x: Any) -> Any:
    """Two planes above, a slanted one below."""
    return np.where(y < 75, np.where(x < 85, 5.0, 7.0), np.clip(5.0 + 2 * (x - 20) / 130, 5, 7))


SCENES: dict[str, Callable[..., Any]] = {"disc": disc, "bent": bent, "steps": steps, "slant": slant}


def surfaces(scene: Callable[..., Any], sign: float, seed: int) -> list[Surface]:
    """A scene: what is nearer than a patch of 6 px has a texture of its own, and hides what is not."""
    paints = [texture(np.random.default_rng(seed + k), waves=12, longest=0.6) for k in (0, 100)]
    if scene in (bent, slant):
        return [(paints[0], lambda y, x: sign * scene(y, x), None)]
    if scene is disc:
        return [
            (paints[0], lambda y, x: sign * 7 + 0 * y * x, lambda y, x: disc(y, x) > 6),
            (paints[1], lambda y, x: sign * 5 + 0 * y * x, None),
        ]
    return [
        (paints[0], lambda y, x: sign * 7 + 0 * y * x, lambda y, x: (y < 75) & (x >= 85)),
        (paints[1], lambda y, x: sign * steps(75 + 0 * y, x), lambda y, x: y >= 75),
        (paints[1], lambda y, x: sign * 5 + 0 * y * x, None),
    ]


def traced_raw(lattice, shape, surfaces, focus, rays=3):
    """Raw image of a plenoptic 2.0 camera by rays: what stands in front hides, lenslets blur out of focus.

    Surfaces are (texture, patch, mask), the nearest first, functions of (y, x) in the plane of the lattice;
    the last one has no mask. A ray through the lenslet C, `o` beside its middle, that ends at C + r comes
    from Y = C - r P/s + o (s - f)/s of a surface of patch s, if the lenslet is sharp at the patch f.
    """
    y, x = np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij")
    index = lattice.index(y, x)
    center = lattice.position(np.stack(index, -1))
    sharp, pitch = np.asarray(focus, float)[lattice.kind(*index)], lattice.pitch
    steps = (np.arange(rays) + 0.5) / rays - 0.5
    through = [(a * pitch, b * pitch) for a in steps for b in steps if np.hypot(a, b) < 0.51]
    total = np.zeros(shape)
    for beside in through:
        light, missed = np.zeros(shape), np.ones(shape, bool)
        for paint, patch, mask in surfaces:
            size = patch(center[..., 0], center[..., 1]) + np.zeros(shape)
            for _ in range(6):  # where it meets the surface: a fixed point
                place = [
                    center[..., k] - (a - center[..., k]) * pitch / size + beside[k] * (size - sharp) / size
                    for k, a in enumerate((y, x))
                ]
                size = patch(*place) + np.zeros(shape)
            hit = missed & (True if mask is None else mask(*place))
            light = np.where(hit, np.maximum(paint(*place), 0), light)
            missed &= ~hit
        total += light
    none = np.zeros((0, 2), int)
    return total / len(through), Calibration(lattice, shape, none, none.astype(float), 0.0)


def scene_of(name: str) -> tuple[np.ndarray, Calibration, list[float] | None, Callable[..., Any]]:
    """Raw image, calibration, focus, and patches as a function of (y, x), such as "square, bent, 0.01"."""
    camera, scene, noise = name.split(", ")
    lattice, focus = CAMERAS[camera]
    sign, seed = np.sign(focus[0]), 1 + list(names()).index(name)
    raw, calibration = traced_raw(lattice, SHAPE, surfaces(SCENES[scene], sign, seed), focus)
    raw = raw + float(noise) * np.random.default_rng(seed).standard_normal(raw.shape)
    return raw, calibration, focus if len(focus) > 1 else None, lambda y, x: sign * SCENES[scene](y, x)


def names() -> Iterator[str]:
    """Of all scenes."""
    return (f"{camera}, {scene}, {noise}" for camera in CAMERAS for scene in SCENES for noise in NOISE)


def measured(name: str) -> dict[str, Any]:
    """A row of the table of scenes."""
    raw, calibration, focus, truth = scene_of(name)
    lenslets = lg.depth.correlation(raw, calibration)
    depth = lg.depth.dense(raw, calibration, lenslets, focus=focus)
    layout = PatchLayout.of(calibration, Patches.of(lenslets.values, calibration), None)
    error, trust = (
        np.abs(np.asarray(depth.values) - truth(layout.y[:, None], layout.x)),
        np.asarray(depth.confidence),
    )
    surer = error.ravel()[np.argsort(-trust, axis=None, kind="stable")[: error.size // 2]]
    return {
        "scene": name,
        "median px": f"{np.median(error):.4f}",
        "mean px": f"{error.mean():.4f}",
        "expected over it": f"{np.mean(depth.error) / error.mean():.2f}",
        "corr. of confidence": f"{np.corrcoef(trust.ravel(), error.ravel())[0, 1]:.2f}",
        "surer half's mean": f"{surer.mean():.4f}",
        "median confidence": f"{np.median(trust):.2f}",
    }


def parts_of(name: str) -> Parts:
    """Terms (term, place) and errors (place,) of a scene, as of `benchmarks.expected`."""
    raw, calibration, focus, truth = scene_of(name)
    lenslets = lg.depth.correlation(raw, calibration)
    sizes = Patches.of(lenslets.values, calibration)
    layout = PatchLayout.of(calibration, sizes, None)
    flat = FlatImage.of(lg.RawImage(raw), calibration)
    sights = Sightings(flat, calibration, layout, checked_focus(focus, calibration))
    found, evidence, _ = moves_of(sights, (sizes, np.asarray(lenslets.confidence)))
    sides = [terms(side * found, evidence, slants=False) for side in (1, -1)]
    parts = [np.maximum(*(side[term] for side in sides)).ravel() for term in MICRO_IMAGES]
    true = sights.flat.even * np.log(np.abs(truth(layout.y[:, None], layout.x)))
    return np.stack(parts), np.abs(found - true).ravel()


def plain(patch: float) -> list[Surface]:
    """A plane of waves that do not repeat."""
    return [(texture(np.random.default_rng(1), waves=12, longest=0.6), lambda y, x: patch + 0 * y * x, None)]


def grating(period: float, patch: float) -> list[Surface]:
    """A plane of waves along both axes, which repeat."""
    k = 2 * np.pi / period

    def paint(y: Any, x: Any) -> Any:
        return 1 + 0.4 * np.cos(k * y + 1) + 0.4 * np.cos(k * x + 2)

    return [(paint, lambda y, x: patch + 0 * y * x, None)]


EVEN: list[Surface] = [(lambda y, x: 1 + 0 * y * x, lambda y, x: 6.0 + 0 * y * x, None)]
Asked = tuple[float, float] | None
CASES: dict[str, tuple[str, list[Surface] | None, float, Asked]] = {
    "a plane": ("square", plain(6.0), 0.01, None),
    "a plane and noise of .3 of it": ("square", plain(6.0), 0.3, None),
    "noise of 2 %": ("square", None, 0.02, None),
    "noise of 30 %": ("square", None, 0.3, None),
    "noise of 30 %, three kinds": ("three kinds", None, 0.3, None),
    "grating of 12 px, square": ("square", grating(12, 6.0), 0.01, None),
    "grating of 8 px, three kinds": ("three kinds", grating(8, 6.0), 0.01, None),
    "grating of 6 px, three kinds": ("three kinds", grating(6, 5.08), 0.01, None),
    "patch of 9, 3 to 5 asked for": ("square", plain(9.0), 0.01, (3, 5)),
    "patch of 4, 8 to 10 asked for": ("square", plain(4.0), 0.01, (8, 10)),
}
"""Camera, scene (None for none), noise, and range of patches to ask for."""


def doubted(name: str) -> dict[str, Any]:
    """A row of the table of cases."""
    camera, scene, noise, asked = CASES[name]
    lattice, focus = CAMERAS[camera]
    raw, calibration = traced_raw(lattice, SHAPE, scene or EVEN, focus)
    raw = np.maximum(raw + noise * np.random.default_rng(5).standard_normal(raw.shape), 0)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        lenslets = lg.depth.correlation(raw, calibration, asked)
        found = lg.depth.dense(raw, calibration, lenslets, focus=focus if len(focus) > 1 else None)
    truth = None if scene is None else scene[0][1](0.0, 0.0)
    off = None if truth is None else np.abs(np.asarray(found.values) - truth)
    sure = np.asarray(found.confidence) > 0.5
    return {
        "case": name,
        "confidence > .5": f"{100 * sure.mean():.1f} %",
        "and off by > .3 px": "" if off is None else f"{100 * (sure & (off > 0.3)).mean():.1f} %",
        "mean error": "" if off is None else f"{off.mean():.3f} px",
        "expected": f"{np.asarray(found.error).mean():.3f} px",
        "said": "; ".join(str(one.message).split(":")[0].split(". ")[0][:60] for one in said),
    }


def run(asked: Sequence[str] = ()) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of both tables, of those whose names begin with one of these."""
    some = tuple(asked) or ("",)
    return [measured(n) for n in names() if n.startswith(some)], [
        doubted(n) for n in CASES if n.startswith(some)
    ]


if __name__ == "__main__":
    if sys.argv[1:] == ["--factors"]:
        show_factors({name: parts_of(name) for name in names()}, MICRO_IMAGES, FITTED)
    else:
        for rows in run(sys.argv[1:]):
            show(rows)
