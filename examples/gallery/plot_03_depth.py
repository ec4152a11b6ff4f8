"""
Depth from a light field, beside the truth
==========================================

`lumigraph.depth.epi` fits a disparity to every place, with a confidence.
"""

import numpy as np

import lumigraph as lg

sample = lg.samples.scene((128, 170))
truth = np.asarray(sample.disparity.values)
found = lg.depth.epi(sample.views)
error = np.abs(np.asarray(found.values) - truth)
ends = truth.min(), truth.max()  # near is above 0
maps = lg.plots.images(
    [(truth, "truth"), (np.nan_to_num(np.asarray(found.values)).clip(*ends), "found")],
    columns=2, cmap="viridis", label="disparity [px per view]",
)  # fmt: skip
errors = lg.plots.images(
    [(np.nan_to_num(error, nan=0.5).clip(0, 0.5), "difference, cut at 0.5 px")],
    label="px per view",
    cmap="magma",
)
wrong = 100 * np.mean(error > 0.3)
print(f"median error {np.nanmedian(error):.3f} px, more than 0.3 px at {wrong:.1f} % of the places")

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph depth samples/scene.zarr -o disparity.pfm --report page.html
