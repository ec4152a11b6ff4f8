"""
A Gaussian beam through a lens
==============================

A laser beam has no sharp focus but a waist. Where it stands, and how wide the beam is before and behind it,
follows from the complex beam parameter; the propagated wave agrees.
"""

import numpy as np

import lumigraph as lg
from lumigraph.scene.sources import gaussian_beam
from lumigraph.units import mm, nm, um

wavelength, waist, focal_length = 633 * nm, 0.5 * mm, 200 * mm
grid = lg.Grid.square(512, 8 * um)
focused = lg.ThinLens(focal_length)(gaussian_beam(grid, wavelength, waist))
z = np.linspace(100 * mm, 300 * mm, 41)
profiles, widths, spots = [], [], []
for distance in z:
    image = lg.propagate(focused, distance).intensity
    spots.append((image[192:320, 192:320] / image.max()).astype(np.float32))
    profiles.append(image[256, 128:384] / image[256].max())
    widths.append(2 * np.sqrt((image.sum(0) * grid.x**2).sum() / image.sum()))
along = np.repeat(np.stack(profiles, 1), 8, axis=1)
figure = lg.plots.images([(along, "from 100 to 300 mm behind the lens")], columns=1)

# %%
# The radius at 1/e² of the intensity is twice the standard deviation. It is compared with w(z) of a beam
# whose parameter q the lens has changed: 1/q' = 1/q - 1/f.

q = 1 / (1 / (-1j * np.pi * waist**2 / wavelength) - 1 / focal_length) + z
theory = np.sqrt(wavelength / (np.pi * np.imag(1 / q)))
radius = lg.plots.curves(
    z / mm,
    {"by its beam parameter": theory / um, "of the propagated wave": (z / mm, np.array(widths) / um)},
    xlabel="behind the lens [mm]",
    ylabel="radius [µm]",
)
print(f"largest difference {1e2 * np.abs(widths / theory - 1).max():.2g} %")

# %%
# Move through the waist:

lg.view_inline(lg.Stack(np.stack(spots), tuple(z), "dz [m]"))
