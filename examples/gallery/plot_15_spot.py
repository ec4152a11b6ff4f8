"""
Poisson's spot
==============

In the middle of the shadow of a round disc it is as bright as if the disc were not there. Poisson thought
that this disproved the wave theory of light; then Arago looked.
"""

import numpy as np

import lumigraph as lg
from lumigraph.scene.sources import gaussian_beam
from lumigraph.units import mm, nm, um

grid, wavelength = lg.Grid.square(1200, 10 * um), 633 * nm
beam = gaussian_beam(grid, wavelength, 3 * mm)
disc = lg.CircularAperture(2 * mm).transmission(grid, wavelength)
stopped = lg.Field(beam.data * (1 - disc), grid, wavelength)
distances = (0.1, 0.3, 1.0, 2.0)
shadows = [lg.propagate(stopped, z).intensity for z in distances]
figure = lg.plots.images(
    [(s[400:800, 400:800], f"{z:g} m behind it") for s, z in zip(shadows, distances, strict=True)], columns=2
)

# %%
# Across the shadow, beside the beam without the disc.

row = slice(400, 800)
curves = {f"{distances[2]:g} m behind the disc": shadows[2][600, row]}
curves["without it"] = lg.propagate(beam, distances[2]).intensity[600, row]
profile = lg.plots.curves(grid.x[row] / mm, curves, xlabel="x [mm]", ylabel="intensity")

# %%
# Move through the shadow:

z = np.linspace(0.1, 2.0, 20)
planes = [lg.propagate(stopped, each).intensity[400:800, 400:800].astype(np.float32) for each in z]
lg.view_inline(lg.Stack(np.stack(planes), tuple(z), "dz [m]"))
