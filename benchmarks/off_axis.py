"""Points on and off the axis of exact cameras, beside direct Rayleigh-Sommerfeld sums in two dimensions.

The reference shares no code with the operators: the way from each place of the stop to each place of the
lenslets, less that to the image, is summed over a disc; then that over 7 x 7 lenslets, to pixels. Relative
rms errors over 11 x 11 pixels around the image are printed.

    python -m benchmarks.off_axis [--converge]
"""

import math
import sys
import time
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev, legendre

from lumigraph import FocusedPlenopticCamera, PlenopticCamera, Points
from lumigraph.operators.lenslets.points import points_image

COUNT = 15
PLACES = (((0, 0), "axis"), ((3, 4), "off, (3, 4)"), ((-4, 4), "off, (-4, 4)"))
"""Lenslets that images lie behind."""


def camera(kind: str, f_number: float, pitch: float) -> Any:
    """With chief rays that are oblique by up to 0.02 rad at f/4."""
    focal_length = 4e-3 * (f_number * pitch) / (4 * 14e-6)
    lenslets = {"pitch": pitch, "focal_length": f_number * pitch, "count": [COUNT, COUNT]}
    parts = {
        "wavelength": "550 nm", "object_distance": 2 * focal_length, "model": "exact",
        "main_lens": {"focal_length": focal_length}, "sensor": {"pixel_pitch": pitch / 10},
    }  # fmt: skip
    if kind == "1.0":
        return PlenopticCamera(**parts, lenslets=lenslets)
    return FocusedPlenopticCamera(**parts, lenslets=lenslets | {"magnification": 0.5}, matching="full")


class Reference:
    """Sums of a camera, with so many times as many nodes."""

    def __init__(self, one: Any, place: tuple[float, float], more: float = 1.0) -> None:
        self.optics, self.place, self.more = one.optics(), place, more
        self.pixel, self.pitch = one.sensor.pixel_pitch, one.lenslets.pitch
        self.k, self.half = 2 * np.pi / self.optics.wavelength, self.optics.pupil_diameter / 2

    def light(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Beside the sphere around the stop's middle, at places (n,) of the lenslets' plane."""
        optics, L, k = self.optics, self.optics.separation, self.k
        (lens,) = optics.lens.elements
        z = 1 / (1 / lens.focal_length - 1 / optics.object_distance)
        nodes, weight = legendre.leggauss(round(70 * self.more))
        count = round(140 * self.more)
        rho, angle = self.half * (nodes + 1) / 2, (np.arange(count) + 0.5) * 2 * np.pi / count
        u, v = np.outer(rho, np.sin(angle)).ravel(), np.outer(rho, np.cos(angle)).ravel()
        weight = np.repeat(weight * rho, count) * self.half / 2 * 2 * np.pi / count
        arrived = np.sqrt(z**2 + (u - self.place[0] * z / L) ** 2 + (v - self.place[1] * z / L) ** 2)
        result = np.empty(len(y), complex)
        for first in range(0, len(y), 128):
            mine = slice(first, first + 128)
            way = np.sqrt(L**2 + (y[mine, None] - u) ** 2 + (x[mine, None] - v) ** 2)
            around = np.sqrt(L**2 + y[mine] ** 2 + x[mine] ** 2)
            result[mine] = (np.exp(1j * k * (way - arrived - around[:, None])) * L / way**2) @ weight
        return result / (optics.wavelength * self.half * math.sqrt(np.pi))

    def behind(self, lenslet: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places behind a lenslet, and the wave there times the quadrature's weights."""
        optics, half = self.optics, self.pitch / 2
        count, fine = round(22 * self.more), round(64 * self.more)
        nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        y, x = np.meshgrid(*(c + half * nodes for c in lenslet), indexing="ij")
        values = self.light(y.ravel(), x.ravel()).reshape(count, count)
        to = np.cos(np.arange(count)[:, None] * np.arccos(nodes)) * 2 / count
        to[0] /= 2
        at, weight = legendre.leggauss(fine)
        smooth = chebyshev.chebgrid2d(at, at, to @ values @ to.T)
        y, x = np.meshgrid(half * at, half * at, indexing="ij")
        f, b, L = optics.array.focal_length, optics.lenslet_distance, optics.separation
        path, inverse = np.sqrt(b**2 + y**2 + x**2) - b, 1 / f - 1 / b
        if inverse > 1e-6:
            path = path + np.sqrt(inverse**-2 + y**2 + x**2) - 1 / inverse
        y, x = y + lenslet[0], x + lenslet[1]
        phase = self.k * (np.sqrt(L**2 + y**2 + x**2) - L - path)
        field = smooth * np.exp(1j * phase) * np.outer(weight, weight) * half**2
        return y.ravel(), x.ravel(), field.ravel()

    def image(self, middle: tuple[float, float], around: int = 3) -> tuple[np.ndarray, np.ndarray]:
        """Intensity on 11 x 11 pixels around a lenslet, and the number of the middle one from the axis."""
        b = self.optics.lenslet_distance
        scale = 1 + b / self.optics.separation
        first = np.round(np.array(middle) * scale / self.pixel)
        nodes, weight = legendre.leggauss(3)
        at = (np.arange(-5, 6)[:, None] + nodes / 2).ravel()
        y, x = (g.ravel() for g in np.meshgrid(*((c + at) * self.pixel for c in first), indexing="ij"))
        total = np.zeros(len(y), complex)
        for i in range(-around, around + 1):
            for j in range(-around, around + 1):
                v, u, field = self.behind((middle[0] + i * self.pitch, middle[1] + j * self.pitch))
                for k0 in range(0, len(y), 256):
                    mine = slice(k0, k0 + 256)
                    way = np.sqrt(b**2 + (y[mine, None] - v) ** 2 + (x[mine, None] - u) ** 2)
                    wave = np.exp(1j * self.k * (way - b)) * b / way**2 * (1 + 1j / (self.k * way))
                    total[mine] += wave @ field
        image = (np.abs(total / self.optics.wavelength) ** 2).reshape(11, 3, 11, 3)
        return np.einsum("iajb,a,b->ij", image, weight / 2, weight / 2), first.astype(int)


def seen(one: Any, place: tuple[float, float], first: np.ndarray) -> np.ndarray:
    """The same pixels of `points_image`, which turns the image by 180°."""
    optics = one.optics()
    at = -np.array(place) * optics.object_distance / optics.separation
    image = points_image(one, Points(np.array([[*at, 0.0]]), np.ones(1)), 1e-3)[::-1, ::-1]
    y, x = (n // 2 + c for n, c in zip(image.shape, first, strict=True))
    share = (optics.object_pitch * optics.separation / optics.object_distance) ** 2
    return image[y - 5 : y + 6, x - 5 : x + 6] / share


def off(image: np.ndarray, expected: np.ndarray) -> float:
    """Relative rms."""
    return float(np.linalg.norm(image - expected) / np.linalg.norm(expected))


def main() -> None:
    """Print the table; with --converge, the sum by 1.3 times the nodes as well."""
    print("camera  lenslets     point         exact    paraxial  CPU s  the sum from one of more nodes")
    for f_number, pitch in ((4, 14e-6), (8, 28e-6)):
        for kind in ("1.0", "2.0"):
            one = camera(kind, f_number, pitch)
            for cell, name in PLACES:
                start, middle = time.process_time(), (cell[0] * pitch, cell[1] * pitch)
                place = middle[0] + 0.086 * pitch, middle[1] - 0.15 * pitch
                expected, first = Reference(one, place).image(middle)
                exact, paraxial = (
                    off(seen(one.replace(model=model), place, first), expected)
                    for model in ("exact", "paraxial")
                )
                told = ""
                if "--converge" in sys.argv:
                    told = f"{off(expected, Reference(one, place, 1.3).image(middle)[0]):.1e}"
                where = f"{kind}     f/{f_number} {pitch * 1e6:3.0f} um   {name:12}"
                spent = time.process_time() - start
                print(f"{where}  {exact:.1e}  {paraxial:.1e}  {spent:5.0f}  {told}", flush=True)


if __name__ == "__main__":
    main()
