"""Deconvolve a noisy raw image of a camera 2.0, beside basic and blended rendering.

python examples/deconvolve_focused.py
"""

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import Exposure, RichardsonLucy, TotalVariation
from lumigraph.operators import periodic_operator
from lumigraph.units import mm, nm, um


def main():
    camera = lg.FocusedPlenopticCamera(
        wavelength=550 * nm,
        object_distance=100 * mm,
        main_lens={"focal_length": 50 * mm},
        lenslets={"pitch": 100 * um, "focal_length": 3 * mm, "count": (9, 9), "magnification": 0.5},
        sensor={"pixel_pitch": 5 * um},
    )
    star = lg.targets.siemens_star(camera.object_grid, 12)
    raw = camera.sensor.expose(lg.simulate(camera, star).data, rng=np.random.default_rng(0))

    operator = periodic_operator(camera, camera.object_grid)
    method = RichardsonLucy(TotalVariation(0.003), accelerated=True)
    found = lg.deconvolve(raw, operator, 40, method=method, exposure=Exposure.of(raw), progress=report)

    pictures = [
        (raw.data, "raw image"),
        (lg.render(raw, camera.calibration, camera.patch), "basic"),
        (lg.render(raw, camera.calibration, camera.patch, blend=True), "blended"),
        (found.data, "deconvolved"),
    ]
    lg.plots.images(pictures, columns=2).savefig("deconvolved.png")
    lg.save(found, "deconvolved.tiff")


def report(step):
    if step.iteration % 20 == 0:
        print(f"iteration {step.iteration}: deviance {step.deviance:.3f}, {step.remaining:.1f} s to go")


if __name__ == "__main__":
    main()
