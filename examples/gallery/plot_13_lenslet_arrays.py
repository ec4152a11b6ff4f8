"""
Lattices of lenslets
====================

Square, hexagonal and multi-focus arrays are one object, in a simulation as in a calibration.
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um

grid = lg.Grid.square(480, 1.2 * mm / 480)
arrays = {
    "square": (lg.Lattice.square(150 * um), 5 * mm),
    "hexagonal": (lg.Lattice.hex(150 * um), 5 * mm),
    "hexagonal, three kinds": (lg.Lattice.hex(150 * um, kinds=3), (4 * mm, 5 * mm, 6.5 * mm)),
}
pictures = []
for name, (lattice, focal_length) in arrays.items():
    array = lg.LensletArray(lattice, focal_length)
    light = array(lg.Field(1 + 0j * grid.y[:, None] * grid.x, grid, 550 * nm))
    pictures.append((lg.propagate(light, 5 * mm, pad=0.5).intensity.clip(0, 25) ** 0.5, name))
figure = lg.plots.images(pictures, columns=3)

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph design multi-focus-hex --web
