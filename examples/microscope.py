"""A vesicle under a light-field microscope: one noisy exposure, and the volume from it.

It lies beyond the focused plane, where directions fill the gaps between the lenslets.

Run: python examples/microscope.py
"""

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import RichardsonLucy, deconvolve, filters
from lumigraph.units import um


def main() -> None:
    scope = lg.LightFieldMicroscope(
        wavelength="525 nm",
        objective={"magnification": 20.0, "numerical_aperture": 0.5},
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": (9, 9)},
        sensor={"pixel_pitch": "6.25 um"},
    )
    print(scope.describe())

    depths = np.arange(16, 65, 8) * um
    operator = scope.operator(depths, 3)
    grid = operator.object_grid
    radius = np.sqrt((depths[:, None, None] - 40 * um) ** 2 + grid.y[:, None] ** 2 + grid.x**2)
    shell = (200 * np.exp(-(((radius - 20 * um) / (2 * um)) ** 2))).astype(np.float32)
    raw = np.random.default_rng(1).poisson(operator.forward(shell) + 1).astype(np.float32)

    widths = filters.widths_of(scope.sampling_distances(depths), grid.pitch[0])
    volume = deconvolve(raw, operator, 20, method=RichardsonLucy(filter=filters.LowPass(widths)))

    middle = len(depths) // 2
    pictures = [
        (raw, "raw image"),
        (shell[middle], "true, through the middle"),
        (volume[middle], "found, through the middle"),
        (volume[:, grid.shape[0] // 2], "found, along the axis"),
    ]
    lg.plots.images(pictures, columns=4).savefig("vesicle.png")
    print(f"correlation with the truth: {np.corrcoef(volume.ravel(), shell.ravel())[0, 1]:.2f}")


if __name__ == "__main__":
    main()
