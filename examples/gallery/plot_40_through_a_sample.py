"""
Through a sample that refracts
==============================

Beads in a row, seen past a ball whose index is 0.02 higher than around it. Light of each bead goes through
thin slices of the ball to the pupil, and from there through the lenslets: what the ball bends comes to
other pixels, and the views of a bead no longer agree on where it is.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import um

scope = lg.LightFieldMicroscope(
    wavelength="525 nm",
    objective={"magnification": 20.0, "numerical_aperture": 0.2},
    lenslets={"pitch": "125 um", "focal_length": "5 mm", "count": (9, 9)},
    sensor={"pixel_pitch": "12.5 um"},
)
grid, z = lg.Grid.square(60, 1 * um), np.arange(-45, -14, 3) * um
radius = np.sqrt(grid.y[:, None] ** 2 + grid.x**2 + (z[:, None, None] + 30 * um) ** 2)
ball = 0.02 / (1 + np.exp((radius - 14 * um) / (1.5 * um)))
medium = lg.Medium.of_index(lg.Volume(ball, grid, tuple(z)))
beads = lg.targets.points([(0, x * um, 10 * um) for x in (-18, -9, 0, 9, 18)])
plain, seen = (lg.simulate(scope, beads, lg.Incoherent(1e-2), medium=one) for one in (None, medium))
print(seen.metadata["error"])
pictures = [
    (np.asarray(raw.data) ** 0.5, name)
    for raw, name in ((plain, "without the ball"), (seen, "past the ball"))
]
figure = lg.plots.images(pictures)

# %%
# Look at it closely:

lg.view_inline(seen)
