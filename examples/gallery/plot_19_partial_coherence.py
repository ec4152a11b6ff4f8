"""
From coherent to incoherent light
=================================

The wider the lamp behind a transparency, the less its light interferes. Coherent light passes fine lines as
well as coarse ones and then not at all; incoherent light dims them little by little, up to twice the
frequency.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

camera = lg.SingleLensCamera(
    wavelength=633 * nm,
    object_distance=316 * mm,
    main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
    sensor={"pixel_pitch": 8 * um, "shape": [96, 96]},
)
lens = 2.5 / 316  # its numerical aperture
star = lg.targets.siemens_star(camera.object_grid, 24)
lights = {
    "coherent": lg.Coherent(),
    "lamp half as wide as the lens": lg.TiltedWaves(60, na=lens / 2),
    "as wide": lg.TiltedWaves(60, na=lens),
    "incoherent": lg.Incoherent(),
}
raws = {name: np.asarray(lg.simulate(camera, star, light).data) for name, light in lights.items()}
figure = lg.plots.images([(raw, name) for name, raw in raws.items()], columns=4)

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph simulate thesis-2f --scene siemens_star --coherence tilted --count 60 -o partial.tiff
#    lumigraph view partial.tiff
