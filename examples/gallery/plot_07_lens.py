"""
Light through a lens, plane by plane
====================================

A slit, 2f before a lens, and its image 2f behind it: diffraction at the slit, the lens' phase, the image.
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um

grid = lg.Grid.square(1200, 8 * um)
slit = lg.RectangularAperture((1 * mm, 0.1 * mm)).transmission(grid, 633 * nm)
field = lg.Field(slit, grid, 633 * nm)
train = lg.Train((lg.Propagate(316 * mm), lg.ThinLens(158 * mm, 5 * mm), lg.Propagate(316 * mm)))
figure = lg.plots.planes(train.planes(field), names=("slit", "before the lens", "behind it", "image"))

# %%
# Play with this camera; every length is a slider:
#
# .. code-block:: sh
#
#    lumigraph design thesis-2f --web
