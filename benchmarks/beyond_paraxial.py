"""Points behind square lenslets from f/52 to f/2, paraxial and exact, beside a direct sum over all surfaces.

The reference shares no code with the operators: Rayleigh and Sommerfeld's integral over the stop by rings,
then over each lenslet by Gauss-Legendre nodes, for a point on the axis. Relative rms errors over 3 x 3
lenslets are printed: paraxial, its estimate, and exact; and the products that exact lenslets take.

    python -m benchmarks.beyond_paraxial
"""

import math
import time
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from lumigraph import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.operators import CameraOptics
from lumigraph.operators.lenslets.exact_lenslets import terms_of
from lumigraph.operators.lenslets.paraxial_error import paraxial_error
from lumigraph.operators.lenslets.point_light import point_light
from lumigraph.operators.lenslets.relay import relay
from lumigraph.operators.sampling.optics import Optics

CASES = (
    ("2.0", 52, 150e-6, 1e-3), ("1.0", 52, 150e-6, 1e-3),
    ("2.0", 20, 125e-6, 1e-3), ("1.0", 20, 125e-6, 1e-3),
    ("2.0", 8, 40e-6, 1e-3), ("1.0", 8, 40e-6, 1e-3), ("2.0", 4, 14e-6, 1e-3), ("1.0", 4, 14e-6, 1e-3),
    ("1.0", 4, 40e-6, 1e-3), ("2.0", 2, 14e-6, 1e-2), ("1.0", 2, 14e-6, 1e-2),
)  # fmt: skip


def camera(kind: str, f_number: float, pitch: float) -> CameraOptics:
    """With a main lens of 100 mm that images 200 mm to 200 mm and fills the micro-images."""
    lenslets = {"pitch": pitch, "focal_length": f_number * pitch, "count": [7, 7]}
    parts = {
        "wavelength": "550 nm", "object_distance": 0.2, "main_lens": {"focal_length": 0.1},
        "sensor": {"pixel_pitch": pitch / 25},
    }  # fmt: skip
    if kind == "1.0":
        return PlenopticCamera(**parts, lenslets=lenslets).optics()
    return FocusedPlenopticCamera(
        **parts, lenslets=lenslets | {"magnification": 0.5}, matching="full"
    ).optics()


def light(optics: CameraOptics, widest: float) -> CubicSpline:
    """Wave of the point on the axis by the distance from it, beside the sphere around the stop's middle."""
    L, k, half = optics.separation, 2 * np.pi / optics.wavelength, optics.pupil_diameter / 2
    z = 1 / (1 / 0.1 - 1 / optics.object_distance)
    at = np.arange(0, 1.1 * widest, optics.wavelength * L / optics.pupil_diameter / 24)
    turns = k * abs(half**2 * (1 / L - 1 / z)) / 2 + k * widest * half / L
    nodes, weight = np.polynomial.legendre.leggauss(60 + int(turns / 2.5))
    rho, angle = half * (nodes + 1) / 2, (np.arange(60 + int(1.1 * k * widest * half / L)) + 0.5) * np.pi
    cosine, arrived = np.cos(angle / len(angle)), (np.sqrt(z * z + rho**2) - z)[:, None]
    values = []
    for r in at:
        way = np.sqrt(L * L + rho[:, None] ** 2 + r * r - 2 * r * np.outer(rho, cosine))
        wave = (np.exp(1j * k * (way - arrived - math.hypot(L, r))) * L / way**2).mean(1)
        values.append(wave @ (2 * np.pi * rho * weight * half / 2))
    return CubicSpline(at, np.array(values) / (optics.wavelength * half * math.sqrt(np.pi)))


def reference(optics: CameraOptics, y: np.ndarray, x: np.ndarray, around: int = 3) -> np.ndarray:
    """Intensity at places (n,) of the sensor."""
    L, b, k = optics.separation, optics.lenslet_distance, 2 * np.pi / optics.wavelength
    pitch, f = optics.lattice.pitch, optics.array.focal_length
    wave, total = light(optics, (around + 0.5) * pitch * math.sqrt(2)), np.zeros(len(y), complex)
    for i in range(-around, around + 1):
        for j in range(-around, around + 1):
            far = max(np.abs(y - i * pitch).max(), np.abs(x - j * pitch).max()) + pitch / 2
            turns = 2 * pitch * (pitch / 2 / f + far / math.hypot(far, b) + 0.05) / optics.wavelength
            nodes, weight = np.polynomial.legendre.leggauss(30 + int(1.1 * turns))
            v, u = np.meshgrid(nodes * pitch / 2, nodes * pitch / 2, indexing="ij")
            path, inverse = np.sqrt(b * b + v**2 + u**2) - b, 1 / f - 1 / b
            if inverse > 1e-6:
                path = path + np.sqrt(inverse**-2 + v**2 + u**2) - 1 / inverse
            v, u = v + i * pitch, u + j * pitch
            r = np.hypot(v, u)
            field = wave(r) * np.exp(1j * k * (np.sqrt(L * L + r * r) - L - path))
            field = (field * np.outer(weight, weight) * pitch**2 / 4).ravel()
            for s in range(0, len(y), 16):
                mine = slice(s, s + 16)
                squared = (y[mine, None] - v.ravel()) ** 2 + (x[mine, None] - u.ravel()) ** 2
                way = np.sqrt(b * b + squared)
                total[mine] += (np.exp(1j * k * (way - b)) * b / way**2 * (1 + 1j / (k * way))) @ field
    return np.abs(total / optics.wavelength) ** 2


def image(optics: Optics) -> tuple[np.ndarray, np.ndarray]:
    """Intensity on the samples of the 3 x 3 cells in the middle, and where they are along an axis [m]."""
    cells, lenslets = optics.cells, relay(optics)
    middle = cells.ring[0] + cells.count[0] // 2
    mine = range(middle - 1, middle + 2)
    y, x = lenslets.places(mine, mine)
    wave = point_light(optics.camera, optics.distance, 2 * max(np.abs(y).max(), np.abs(x).max()))
    field = lenslets.field(wave.at(y, x).astype(np.complex64), mine, mine)
    at = (np.arange(3 * cells.samples[0]) + 0.5) / cells.samples[0] - 1.5
    return np.abs(field) ** 2 / optics.image_scale**2, at * cells.size[0] * optics.image_scale


def main() -> None:
    """Print the table."""
    print("camera  lenslets        paraxial  estimated  exact    products  seconds")
    for kind, f_number, pitch, accuracy in CASES:
        known, errors, seconds = camera(kind, f_number, pitch), [], []
        expected = picked = np.zeros(0)
        for model in ("paraxial", "exact"):
            optics = Optics.of(replace(known, model=model), known.object_distance, accuracy)
            start = time.process_time()
            found, at = image(optics)
            seconds.append(time.process_time() - start)
            if model == "paraxial":
                step = max(1, len(at) // 21)
                picked = np.arange(step // 2, len(at), step)
                y, x = (g.ravel() for g in np.meshgrid(at[picked], at[picked], indexing="ij"))
                expected = reference(known, y, x)
            seen = found[np.ix_(picked, picked)].ravel()
            errors.append(float(np.linalg.norm(seen - expected) / np.linalg.norm(expected)))
        where = f"{kind}     f/{f_number:<3} {pitch * 1e6:5.0f} um"
        shown = f"{errors[0]:.1e}   {paraxial_error(known):.1e}    {errors[1]:.1e}  {terms_of(optics):>4}"
        print(f"{where}   {shown}      {seconds[0]:.2f}, {seconds[1]:.2f}", flush=True)


if __name__ == "__main__":
    main()
