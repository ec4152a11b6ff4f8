"""What hides what, against brute force: ``python -m benchmarks.hiding``.

A chart of bars behind a knife edge. Each sample of the chart is some points that send their own waves past
the edge, by Fresnel's integrals, through the main lens and the lenslets, by the quadratures of `references`;
the images add up. Nothing of lumigraph's screens, cones or operators takes part.
"""

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.special import fresnel

from benchmarks.references import Fineness, Point, Relay

Edge = tuple[float, float, float]
"""Distance to the main lens, and where an opaque strip begins and ends along x [m]."""

FINE = Fineness(lenslet=40, pixel=3, pupil=400)


def past_strip(strip: Edge, distance: float, x: float, u: np.ndarray, wavelength: float) -> np.ndarray:
    """Factor that an opaque strip leaves of the amplitude at u of the main lens, of a point at x [m]."""
    z, low, high = strip
    seen = x * z / distance + u * (1 - z / distance)
    zone = math.sqrt(wavelength * z * (1 - z / distance) / 2)
    (s0, c0), (s1, c1) = (fresnel((end - seen) / zone) for end in (low, high))
    return 1 - ((c1 - c0) + 1j * (s1 - s0)) / (1 + 1j)


class Bench:
    """A camera behind strips, and what it sees of points on one plane."""

    def __init__(self, camera: Any, dz: float, strips: Sequence[Edge], fineness: Fineness = FINE) -> None:
        self.camera, self.distance, self.strips = camera, camera.object_distance + dz, strips
        self.relay = Relay(camera, fineness)
        n, finer = fineness.pupil, 16
        half, (lens,) = camera.pupil_diameter / 2, camera.lens_train().elements
        fine = (np.arange(n * finer) + 0.5) / (n * finer) * 2 - 1
        chord = np.sqrt(1 - fine**2)
        edges = np.linspace(-1, 1, n + 1)
        covered = np.clip(
            np.minimum(edges[1:], chord[:, None]) - np.maximum(edges[:-1], -chord[:, None]), 0, 2
        )
        covered = covered.reshape(n, finer, n).mean(1) * n / 2
        self.u = (np.arange(n) + 0.5) / n * 2 * half - half
        power = 1 / self.distance + 1 / camera.separation - 1 / lens.focal_length
        bend = np.exp(1j * np.pi * power * self.u**2 / camera.wavelength)
        self.pupil = covered * np.outer(bend, bend)
        squared = camera.wavelength * camera.separation
        self.pupil /= math.sqrt(math.pi) * half * squared / (self.u[1] - self.u[0]) ** 2

    def light(self, point: Point) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Function ``(y, x)`` of a point's amplitude in the lenslet plane."""
        L, wavelength = self.camera.separation, self.camera.wavelength
        squared, wave = wavelength * L, self.pupil
        for strip in self.strips:
            wave = wave * past_strip(strip, self.distance, point[1], self.u, wavelength)

        def amplitude(y: np.ndarray, x: np.ndarray) -> np.ndarray:
            down, across = (
                np.exp(-2j * np.pi * np.outer(at + c * L / self.distance, self.u) / squared)
                * np.exp(1j * np.pi * at**2 / squared)[:, None]
                for at, c in zip((y, x), point, strict=True)
            )
            return down @ wave @ across.T

        return amplitude

    def image(self, points: Sequence[Point], intensities: Sequence[float], pitch: float) -> np.ndarray:
        """Raw image (ny, nx) of points that stand for samples of a pitch [m]."""
        fields = self.relay.fields([self.light(point) for point in points])
        total: Any = sum(i * np.abs(f) ** 2 for i, f in zip(intensities, fields, strict=True))
        return self.relay.pixels(total) * (pitch * self.camera.separation / self.distance) ** 2


def chart(camera: Any, dz: float, samples: int, bars: int, pitch: float | None = None) -> Any:
    """A small chart of bars of so many samples, as a slice; the camera resolves two of the usual pitch."""
    from lumigraph.core.grid import Grid
    from lumigraph.scene import Slice

    pitch = pitch or camera.lattice.pitch * (camera.object_distance + dz) / camera.separation / 8
    bright = np.arange(samples) // bars % 2 == 0
    shade = 1 + 0.3 * np.sin(np.arange(samples))
    return Slice(np.outer(shade, bright), Grid.square(samples, pitch), dz)


def sheet(strip: Edge, object_distance: float, height: float = 4e-3) -> Any:
    """An opaque strip that gives off no light, as a slice."""
    from lumigraph.core.grid import Grid
    from lumigraph.scene import Slice

    distance, low, high = strip
    grid = Grid((2, 2), (height / 2, (high - low) / 2), (height / 4, low + 0.75 * (high - low)))
    return Slice(np.zeros((2, 2)), grid, distance - object_distance, opacity=1.0)


def brute_force(
    camera: Any, part: Any, strips: Sequence[Edge], fineness: Fineness = FINE, looks: int = 4
) -> np.ndarray:
    """Raw image (ny, nx) of a slice behind strips: of so many points side by side in each sample."""
    pitch = part.grid.pitch[0]
    off = ((np.arange(looks) + 0.5) / looks - 0.5) * pitch
    points = [(y, x + d) for y in part.grid.y for x in part.grid.x for d in off]
    bench = Bench(camera, part.dz, strips, fineness)
    return bench.image(points, np.repeat(part.intensity.ravel() / looks, looks), pitch)


def run() -> None:
    """Print how far off simulated charts behind a knife edge are."""
    sys.path.insert(0, "tests")
    import cameras
    from lumigraph.scene import Scene
    from lumigraph.simulation import Incoherent, simulate
    from lumigraph.units import mm, um

    camera = cameras.focused(count=(5, 5))
    print("chart [mm]  edge [mm]  edge at [um]  passes     rms error  stated")
    for dz, nearer, low, bars in (
        (0, 10, 0, 2), (0, 40, 0, 2), (20, 20, 110, 3), (20, 2, 110, 3), (5, 5, -60, 4), (5, 2, 20, 4),
    ):  # fmt: skip
        part = chart(camera, dz * mm, 12, bars)
        strip = (camera.object_distance + (dz - nearer) * mm, low * um, 10 * mm)
        expected = brute_force(camera, part, [strip])
        free = simulate(camera, Scene([part]), Incoherent(1e-3)).data
        raw = simulate(camera, Scene([part, sheet(strip, camera.object_distance)]), Incoherent(1e-2))
        off = np.linalg.norm(raw.data - expected) / np.linalg.norm(expected)
        passes = expected.sum() / free.sum()
        stated = raw.metadata["error"]["rms"]
        print(
            f"{dz:10.0f} {dz - nearer:10.0f} {low:13.0f} {passes:7.3f} {off:14.2e} {stated:7.1e}", flush=True
        )


if __name__ == "__main__":
    run()
