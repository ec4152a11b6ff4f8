"""
Sharp all over
==============

From a stack of refocused pictures, each place takes the one in which it is sharpest.
"""

import numpy as np

import lumigraph as lg

views = lg.samples.scene((128, 170)).views
sharp = lg.all_in_focus(views, np.linspace(0.84, 1.16, 33))
plain = lg.refocus(views, 1.0)
figure = lg.plots.images(
    [
        (np.clip(p, 0, 1) ** (1 / 2.2), name)
        for p, name in ((plain, "one focus"), (sharp.picture, "all in focus"))
    ],
    columns=2,
)

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph render samples/scene.zarr --all-in-focus --map alpha.tiff -o sharp.png
