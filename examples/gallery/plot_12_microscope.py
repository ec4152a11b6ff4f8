"""
A volume from one exposure of a microscope
==========================================

A vesicle, 40 µm across: the raw image behind the lenslets, and the volume that deconvolution finds in it.
"""

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import RichardsonLucy, filters

sample = lg.samples.volume()
truth = np.asarray(sample.volume.data)
operator = sample.camera.operator(sample.volume.depths, sample.samples_per_lenslet, accuracy=1e-2)
widths = filters.widths_of(
    sample.camera.sampling_distances(sample.volume.depths), operator.object_grid.pitch[0]
)
found = lg.deconvolve(sample.raw, operator, 15, method=RichardsonLucy(filter=filters.LowPass(widths)))
found = np.asarray(getattr(found, "data", found))
middle = len(truth) // 2
figure = lg.plots.images(
    [(sample.raw.data, "raw image"), (truth[middle], "true middle plane"), (found[middle], "found")],
    columns=3,
)
print(f"correlation with the truth {np.corrcoef(found.ravel(), truth.ravel())[0, 1]:.2f}")

# %%
# The volume to move through:

lg.view_inline(lg.Volume(found, operator.object_grid, sample.volume.depths))
