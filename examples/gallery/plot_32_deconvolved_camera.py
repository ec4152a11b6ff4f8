"""
A sharper picture from all the light
====================================

Rendering keeps a patch of each micro-image and throws the rest away. Deconvolution asks which object
explains every pixel of the raw image.
"""

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import Exposure, RichardsonLucy, TotalVariation
from lumigraph.operators import periodic_operator
from lumigraph.units import mm, nm, um

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
found = lg.deconvolve(raw, operator, 40, method=method, exposure=Exposure.of(raw))
figure = lg.plots.images(
    [
        (raw.data, "raw image, with noise"),
        (lg.render(raw, camera.calibration, camera.patch, blend=True), "rendered"),
        (found.data, "deconvolved"),
    ],
    columns=3,
)

# %%
# Look closely:

lg.view_inline(found)
