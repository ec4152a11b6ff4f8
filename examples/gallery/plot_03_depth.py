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
figure = lg.plots.images(
    [
        (truth - truth.min(), "true disparity, near is bright"),
        (np.nan_to_num(np.asarray(found.values) - truth.min()).clip(0, np.ptp(truth)), "found"),
        (np.nan_to_num(error, nan=1.0).clip(0, 0.5), "error, white from 0.5 px"),
    ],
    columns=3,
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
