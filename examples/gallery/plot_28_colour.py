"""
A Bayer sensor, and colours again
=================================

Each wavelength is propagated on its own; the sensor's filters mix them. `lumigraph.demosaic` brings back
what the mosaic left out.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

camera = lg.SingleLensCamera(
    wavelength=550 * nm,
    object_distance=200 * mm,
    main_lens={"focal_length": 100 * mm, "diameter": 8 * mm},
    sensor={"pixel_pitch": 4 * um, "shape": [240, 240]},
)
painted = lg.samples.scene((240, 240), 3).views.view(1, 1)
scene = lg.targets.photo(camera.object_grid, painted)
mosaic = lg.simulate(camera, scene, spectrum=lg.Spectrum.rgb(bayer="RGGB"))
picture = lg.demosaic(mosaic)
figure = lg.plots.images(
    [
        (mosaic.data ** (1 / 2.2), "what the pixels record"),
        (np.clip(picture.data, 0, 1) ** (1 / 2.2), "demosaiced"),
    ],
    columns=2,
)

# %%
# Look at the pixels:

lg.view_inline(mosaic)
