"""
A volume from all sides
=======================

A shell of fluorescent dye, from one exposure: the brightest value along each axis, and the volume to move
through.
"""

import lumigraph as lg
from lumigraph.deconvolution import RichardsonLucy, filters

sample = lg.samples.volume()
depths = sample.volume.depths
operator = sample.camera.operator(depths, sample.samples_per_lenslet, accuracy=1e-2)
widths = filters.widths_of(sample.camera.low_pass_distances(depths), operator.object_grid.pitch[0])
method = RichardsonLucy(filter=filters.LowPass(widths))
found = lg.deconvolve(sample.raw, operator, 20, method=method)
truth = lg.plots.projections(sample.volume)
figure = lg.plots.projections(found)

# %%
# Above the truth, below what was found. Move through it:

lg.view_inline(found)
