"""
From the shadow of a hole to its far field
==========================================

A round hole of 1 mm in light of 633 nm. At distances of a²/(Nλ), N Fresnel zones fit into it: the middle is
bright for odd N and dark for even N. Much farther, only the Airy pattern is left.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

grid, wavelength = lg.Grid.square(640, 6.25 * um), 633 * nm
hole = lg.Field(lg.CircularAperture(1 * mm).transmission(grid, wavelength), grid, wavelength)
pictures = []
for zones in (6, 5, 2, 1, 0.5, 0.25):
    z = (0.5 * mm) ** 2 / (zones * wavelength)
    image = lg.propagate(hole, z, "auto").intensity[200:440, 200:440]
    pictures.append((image, f"{zones:g} zones, {z:.3g} m"))
figure = lg.plots.images(pictures, columns=3)

# %%
# Move through them:

z = np.geomspace(0.05, 2.0, 24)
planes = [lg.propagate(hole, each, "auto").intensity[200:440, 200:440].astype(np.float32) for each in z]
lg.view_inline(lg.Stack(np.stack(planes), tuple(z), "dz [m]"))
