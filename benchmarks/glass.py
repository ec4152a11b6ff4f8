"""Lenslets of glass beside Kirchhoff's integral over their curved side, along the axis and aslant.

    python -m benchmarks.glass

Along the axis one square lenslet, as `tests/elements/test_surface.py` has it; aslant one cylindrical lenslet
of the same width, whose waves have two dimensions, around the place where its chief ray arrives. n = 1.5,
550 nm, the curved side towards the sensor in its focal plane; relative rms within 8 λ f/p, aslant 6 λ f/p, at
equal power. *model* is `GlassSurface`, *sagitta* the path (n - 1) s of the surface at the same height,
*ideal* a lenslet free of spherical aberration.
"""

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import hankel1

from lumigraph.elements.surface import GlassSurface
from lumigraph.units import um

INDEX, WAVELENGTH = 1.5, 550e-9
K = 2 * np.pi / WAVELENGTH
LENSLETS = (
    (8, 40 * um, 0.0),
    (4, 14 * um, 0.0),
    (4, 40 * um, 0.0),
    (3, 14 * um, 0.0),
    (4, 40 * um, -(INDEX**2)),
)
SLANTED = ((8, 40 * um), (4, 14 * um))
ANGLES = (0.0, 0.03, 0.06)


def surface(conic: float, f: float, squared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sagitta and root √(r² - (1 + K) v²) [m] by the squared height."""
    radius = (INDEX - 1) * f
    root = np.sqrt(radius**2 - (1 + conic) * squared)
    return squared / (radius + root), root


def square(half: float, f: float, conic: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Intensity along a slanted line through the focus: of the glass, and of all models."""
    nodes, weights = leggauss(220)
    y, x = np.meshgrid(nodes, nodes, indexing="ij")
    weight, at = np.outer(weights, weights), np.linspace(-8, 8, 61) * WAVELENGTH * f / (2 * half)
    at = at[np.abs(at) < half]
    squared = half**2 * (y * y + x * x)
    sag, root = surface(conic, f, squared)
    inside = np.arctan(np.sqrt(squared) / root)
    outside = np.arcsin(INDEX * np.sin(inside))
    light = np.exp(-1j * K * INDEX * sag) * np.sqrt(np.cos(inside) / np.cos(outside))
    truth, glass = [], GlassSurface(INDEX, conic)
    for v, u in zip(0.8 * at, 0.6 * at, strict=True):
        dy, dx, dz = v - half * y, u - half * x, f + sag
        way = np.sqrt(dy**2 + dx**2 + dz**2)
        towards = np.cos(inside) * (half * (dy * y + dx * x) / root + dz) / way
        slope = 1j * K * (towards + np.cos(outside)) - towards / way
        wave = light * np.exp(1j * K * way) / (4 * np.pi * way) * slope
        truth.append(np.sum(wave * weight * half**2 / np.cos(inside)))

    def plane(wide: float, field: np.ndarray) -> np.ndarray:
        seen = []
        for v, u in zip(0.8 * at, 0.6 * at, strict=True):
            way = np.sqrt((v - wide * y) ** 2 + (u - wide * x) ** 2 + f * f)
            wave = field * f / way**2 * (1 + 1j / (K * way)) * np.exp(1j * K * way)
            seen.append(np.sum(wave * weight * wide**2) / WAVELENGTH)
        return np.abs(np.array(seen)) ** 2

    wide = glass.seen(half, f)
    own = wide**2 * (y * y + x * x)
    return np.abs(np.array(truth)) ** 2, {
        "model": plane(wide, glass.amplitude(own, half, f) * np.exp(-1j * K * glass.path(own, half, f))),
        "sagitta": plane(half, np.exp(-1j * K * (INDEX - 1) * sag)),
        "ideal": plane(half, np.exp(-1j * K * (np.sqrt(f * f + squared) - f))),
    }


def cylinder(half: float, f: float, angle: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The same across a cylindrical lenslet, of a plane wave that arrives at an angle [rad]."""
    nodes, weight = leggauss(3000)
    v, at = half * nodes, f * np.tan(angle) + np.linspace(-6, 6, 401) * WAVELENGTH * f / (2 * half)
    sag, root = surface(0.0, f, v * v)
    normal, slant = np.arctan(v / root), np.arcsin(np.sin(angle) / INDEX)
    along = K * INDEX * (np.sin(slant) * np.cos(normal) - np.cos(slant) * np.sin(normal))
    out, into = np.sqrt(K**2 - along**2), np.sqrt((K * INDEX) ** 2 - along**2)
    light = np.exp(1j * K * INDEX * (np.sin(slant) * v - np.cos(slant) * sag)) * np.sqrt(into / out / INDEX)
    dv, dz = at[:, None] - v, f + sag
    way = np.hypot(dv, dz)
    towards = (np.sin(normal) * dv + np.cos(normal) * dz) / way
    green, slope = 0.25j * hankel1(0, K * way), 0.25j * K * hankel1(1, K * way) * towards
    truth = (slope - 1j * out * green) @ (light * weight * half / np.cos(normal))

    def plane(wide: float, field: np.ndarray) -> np.ndarray:
        apart = np.hypot(f, at[:, None] - wide * nodes)
        tilted = field * np.exp(1j * K * np.sin(angle) * wide * nodes) * weight * wide
        return np.abs((hankel1(1, K * apart) * f / apart) @ tilted) ** 2

    turned = np.arcsin(INDEX * np.sin(normal)) - normal
    seen = v - sag * np.tan(turned)
    wide = float(seen[-1] + (half - v[-1]) * (seen[-1] - seen[-2]) / (v[-1] - v[-2]))
    own = np.interp(wide * nodes, seen, v)
    density = np.gradient(own, wide * nodes) / np.cos(np.interp(own, v, turned))
    path = GlassSurface(INDEX).path((wide * nodes) ** 2, half, f)
    return np.abs(truth) ** 2, {
        "model": plane(wide, np.sqrt(density) * np.exp(-1j * K * path)),
        "sagitta": plane(half, np.exp(-1j * K * (INDEX - 1) * sag)),
        "ideal": plane(half, np.exp(-1j * K * (np.sqrt(f * f + v * v) - f))),
    }


def off(image: np.ndarray, truth: np.ndarray) -> float:
    """Relative rms at equal power."""
    return float(np.linalg.norm(image * truth.sum() / image.sum() - truth) / np.linalg.norm(truth))


def main() -> None:
    """Print both tables."""
    print("| lenslet | light | model | sagitta | ideal |\n|---|---|---|---|---|")
    for f_number, pitch, conic in LENSLETS:
        truth, images = square(pitch / 2, f_number * pitch, conic)
        name = f"f/{f_number}, {pitch / um:g} µm, K = {conic:g}"
        told = " | ".join(f"{np.linalg.norm(i - truth) / np.linalg.norm(truth):.1e}" for i in images.values())
        print(f"| {name} | along the axis | {told} |", flush=True)
    for f_number, pitch in SLANTED:
        for angle in ANGLES:
            truth, images = cylinder(pitch / 2, f_number * pitch, angle)
            told = " | ".join(f"{off(image, truth):.1e}" for image in images.values())
            print(f"| f/{f_number}, {pitch / um:g} µm, cylinder | {angle:g} rad | {told} |", flush=True)


if __name__ == "__main__":
    main()
