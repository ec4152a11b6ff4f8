"""
The shape of the blur
=====================

The aperture is chosen after the exposure too. What is out of focus takes its shape.
"""

import numpy as np

import lumigraph as lg

views = lg.samples.scene().views
step = views.lenslets.pitch[1] / views.aperture.pitch[1]
apertures = [
    (views, "square, full"),
    (lg.reduce_aperture(views, 1.0, shape="round"), "round, full"),
    (lg.reduce_aperture(views, 0.34), "stopped down to a third"),
]
pictures = [(np.clip(lg.refocus(kept, 1 - 0.3 * step), 0, 1) ** (1 / 2.2), name) for kept, name in apertures]
figure = lg.plots.images([(p[:100, 40:216], name) for p, name in pictures], columns=3)

# %%
# Play with it; the small aperture beside the picture opens, closes and moves:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph view samples/scene.zarr
