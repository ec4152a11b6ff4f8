"""
Phase contrast
==============

What is transparent changes only the phase of light, and no camera sees that. Zernike delayed the light that
goes straight through by a quarter of a wave, with a small plate in the focal plane of a lens: phase becomes
brightness.
"""

import numpy as np

import lumigraph as lg
from lumigraph.scene.sources import gaussian_beam
from lumigraph.units import mm, nm, um

wavelength, focal_length = 550 * nm, 200 * mm
grid = lg.Grid.square(800, 10 * um)
cells = np.asarray(lg.targets.siemens_star(grid, 16, 5 * mm).parts[0].intensity)
field = gaussian_beam(grid, wavelength, 2.5 * mm) * np.exp(0.4j * cells)


def microscope(plate):
    """Two lenses, 2f apart, and a plate in the focal plane between them."""
    way = lg.Propagate(focal_length)
    return lg.Train((way, lg.ThinLens(focal_length), way, plate, way, lg.ThinLens(focal_length), way))


def straight(turn):
    """A plate that multiplies the light in its middle by `turn`."""
    spot = lg.CircularAperture(240 * um)
    return lambda at: at * (1 + (turn - 1) * spot.transmission(at.grid, at.wavelength))


plates = {
    "no plate": lambda at: at,
    "straight light stopped: dark ground": straight(0.0),
    "a quarter of a wave: phase contrast": straight(1j),
    "and dimmed to a fifth": straight(0.447j),
}
inside = slice(120, 680)
pictures = [(microscope(p)(field).intensity[inside, inside], name) for name, p in plates.items()]
figure = lg.plots.images(pictures, columns=2, label="intensity")

# %%
# From plate to plate:

lg.view_inline(lg.Stack(np.stack([picture.astype(np.float32) for picture, _ in pictures])))
