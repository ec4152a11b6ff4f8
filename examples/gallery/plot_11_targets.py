"""
Test charts
===========

What stands before a camera: each target knows its place in object space.
"""

import lumigraph as lg
from lumigraph.units import mm, um

grid = lg.Grid.square(512, 8 * mm / 512)
painted = lg.samples.scene((384, 512), 3).views.view(1, 1).mean(axis=-1)
charts = {
    "USAF 1951": lg.targets.usaf1951(grid, 1),
    "Siemens star": lg.targets.siemens_star(grid),
    "gratings": lg.targets.gratings(grid, (1e3, 2e3, 4e3)),
    "slanted edge": lg.targets.slanted_edge(grid),
    "pinhole": lg.targets.pinhole(grid, 400 * um),
    "photograph": lg.targets.photo(grid, painted),
}
figure = lg.plots.images([(scene.parts[0].intensity, name) for name, scene in charts.items()], columns=3)

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph simulate thesis-2f --scene usaf1951 -o chart.tiff
#    lumigraph view chart.tiff
