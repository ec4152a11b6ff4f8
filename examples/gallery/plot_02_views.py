"""
Parallax, and lines in epipolar-plane images
============================================

Side by side, the views of a light field show parallax. One row of all of them, stacked, shows a line for
every point: the steeper, the nearer.
"""

import numpy as np

import lumigraph as lg

views = lg.samples.scene().views
shown = np.clip(views.data, 0, 1) ** (1 / 2.2)
figure = lg.plots.images(
    [
        (shown[4, 0], "from the left"),
        (shown[4, 8], "from the right"),
        (np.repeat(shown[4, :, 150], 16, axis=0), "row 150 of the nine views between them"),
    ],
    columns=3,
)

# %%
# Play with it; the key E shows the lines through the pointer:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph view samples/scene.zarr
