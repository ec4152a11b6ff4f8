"""
Refocus after the exposure
==========================

A light field holds what light came from where. Shear it, sum it, and another plane is sharp.
"""

import numpy as np

import lumigraph as lg

sample = lg.samples.scene()
views, disparity = sample.views, np.asarray(sample.disparity.values)

# %%
# A thing that moves by d samples from view to view is sharp at the refocus factor α' = 1 - d · (lenslet
# pitch) / (spacing of the views). The leaves move by 2 samples, the robot by 0.3, the wall by -2.

step = views.lenslets.pitch[1] / views.aperture.pitch[1]
pictures = [
    (np.clip(lg.refocus(views, 1 - d * step), 0, 1) ** (1 / 2.2), name)
    for d, name in (
        (disparity.max(), "the leaves"),
        (disparity[90, 128], "the robot"),
        (disparity[4, 4], "the wall"),
    )
]
figure = lg.plots.images(pictures, columns=3)

# %%
# The same light field as a living picture: click what should be sharp, drag to look around.

lg.view_inline(views)
