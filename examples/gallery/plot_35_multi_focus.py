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
places = [(y * mm, x * mm) for y in (-1.0, 1.0) for x in (-1.0, 1.0)]
pictures = []
for dz in (0.0, 25 * mm):
    points = lg.targets.points([(y, x, dz) for y, x in places])
    raw = lg.simulate(camera, points, lg.Incoherent(accuracy=1e-2))
    pictures.append((raw.data**0.5, f"points at {dz / mm:g} mm"))
figure = lg.plots.images(pictures, columns=2)

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
