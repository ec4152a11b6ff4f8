"""
A wavefront on lenslets
=======================

A tilted wave moves the spot behind a lenslet by f tan θ. So the spots of an array show the slope of a
wavefront in each place: even for a flat wave, displaced where it is aberrated.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

grid, wavelength, pitch, focal_length = lg.Grid.square(660, 4 * um), 633 * nm, 240 * um, 10 * mm
array = lg.LensletArray(lg.Lattice.square(pitch), focal_length)
flat = lg.Field(np.ones(grid.shape, np.complex64), grid, wavelength)
waves = {
    "flat": (),
    "defocus and astigmatism": ((4, 4.0), (6, 3.0)),
    "coma": ((8, 4.0),),
    "spherical": ((11, 3.0),),
}
spots = {}
for name, terms in waves.items():
    plate = (lg.ZernikePlate(terms, 2.6 * mm),) if terms else ()
    spots[name] = lg.propagate(lg.Train((*plate, array))(flat), focal_length).intensity
figure = lg.plots.images([(image**0.5, name) for name, image in spots.items()], columns=2)

# %%
# From wave to wave:

lg.view_inline(lg.Stack(np.stack([image.astype(np.float32) for image in spots.values()])))
