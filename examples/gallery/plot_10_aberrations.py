"""
Aberrations of the main lens
============================

The image of a point behind Zernike plates of a quarter and a half wave, Noll's numbers.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

grid = lg.Grid.square(300, 6 * mm / 300)
wavelength, focal_length = 550 * nm, 200 * mm
target = lg.Grid.square(96, 3 * um)
pictures = []
for name, terms in (
    ("ideal", ()),
    ("astigmatism", ((6, np.pi / 2),)),
    ("coma", ((8, np.pi / 2),)),
    ("trefoil", ((10, np.pi / 2),)),
    ("spherical", ((11, np.pi / 2),)),
    ("a mixture", ((5, 1.0), (8, 1.5), (9, 0.8), (11, -0.7))),
):
    plates = (lg.ZernikePlate(terms, 5 * mm),) if terms else ()
    lens = lg.Train((*plates, lg.ThinLens(focal_length, 5 * mm)))
    light = lens(lg.Field(np.ones(grid.shape, np.complex64), grid, wavelength))
    image = lg.propagate(light, focal_length, method="zoom", grid=target).intensity
    pictures.append(((image / image.max()) ** 0.4, name))
figure = lg.plots.images(pictures, columns=3)

# %%
# Look at each closely:

lg.view_inline(lg.Stack(np.stack([picture.astype(np.float32) for picture, _ in pictures])))
