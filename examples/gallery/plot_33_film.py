"""
A walk round the aperture
=========================

The point of view runs once round the aperture while the robot stands still: what is nearer and what is
farther moves against each other. The pictures become a film.
"""

from pathlib import Path

import numpy as np

import lumigraph as lg

views = lg.samples.scene((144, 192)).views
step = views.lenslets.pitch[1] / views.aperture.pitch[1]
frames = lg.view_path(views, 24, alpha=1 - 0.3 * step)
film = Path("round-the-aperture.gif")
lg.save(list(np.round(255 * np.clip(frames, 0, 1) ** (1 / 2.2)).astype(np.uint8)), film, fps=12)
figure = lg.plots.images(
    [(np.clip(frames[k], 0, 1) ** (1 / 2.2), f"frame {k}") for k in (0, 6, 12, 18)], columns=4
)

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph render samples/scene.zarr --path circle -o around.gif
#    lumigraph view samples/scene.zarr
