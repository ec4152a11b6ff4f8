"""
Three focal lengths on a hexagonal array
========================================

A multi-focus camera has three kinds of lenslets, each sharp at a depth of its own. Points at two depths
show which kind sees which one best.
"""

import lumigraph as lg
from lumigraph.units import mm

camera = lg.FocusedPlenopticCamera.from_catalogue("multi-focus-hex")
camera = camera.replace(lenslets={"count": (9, 9)}, sensor={"pixel_pitch": 5e-6})
points = [(y * mm, x * mm, dz * mm) for y in (-1.0, 1.0) for x, dz in ((-1.0, 0.0), (1.0, 25.0))]
raw = lg.simulate(camera, lg.targets.points(points), lg.Incoherent(accuracy=1e-2))
figure = lg.plots.images([(raw.data**0.5, "points at 0 mm (left) and at 25 mm (right)")])

# %%
# The whole camera:
#
# .. code-block:: sh
#
#    lumigraph design multi-focus-hex --plot rays.png

# %%
# Play with the camera:
#
# .. code-block:: sh
#
#    lumigraph design multi-focus-hex --web
