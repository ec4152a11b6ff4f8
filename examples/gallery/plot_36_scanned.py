"""
Nine light fields of one star
=============================

In its focused plane a plenoptic camera samples the object once for each lenslet. Moved by a third of a
lenslet between raw images, the object is sampled three times as finely; deconvolved together, nine raw images
of a ninth of the light resolve what one of all the light does not.
"""

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import RichardsonLucy, Stop
from lumigraph.units import mm, nm, um

camera = lg.PlenopticCamera(
    wavelength=550 * nm,
    object_distance=200 * mm,
    main_lens={"focal_length": 100 * mm},
    lenslets={"pitch": 100 * um, "focal_length": 2.5 * mm, "count": (11, 11)},
    sensor={"pixel_pitch": 10 * um, "full_well": 1e5, "bits": 16, "read_noise": 2},
)
grid = camera.object_grid
star = lg.targets.siemens_star(grid, 10).parts[0].intensity
rng = np.random.default_rng(0)


def seen(shift, photons):
    """Raw image of the star moved by (y, x)."""
    y, x = grid.center
    there = lg.Grid(grid.shape, grid.pitch, (y + shift[0], x + shift[1]))
    light = lg.simulate(camera, lg.Scene([lg.Slice(star, there)]), lg.Incoherent(1e-2)).data
    return camera.sensor.expose(np.maximum(light, 0), photons=photons, rng=rng)


found = {}
for name, steps in (("one raw image", 1), ("nine, each of a ninth of the light", 3)):
    shifts = lg.scan(steps, 100 * um)
    raws = [seen(shift, 4500 / len(shifts)) for shift in shifts]
    operator = lg.joint_operator(camera, samples_per_lenslet=10, shifts=shifts, accuracy=1e-2)
    method = RichardsonLucy(accelerated=True)
    found[name] = lg.deconvolve(raws, operator, Stop(15, deviance=1), method=method)

pictures = [(np.minimum(p.data / p.data.mean(), 3), name) for name, p in found.items()]
figure = lg.plots.images([(star, "object"), *pictures], columns=3)

# %%
# Look closely:

lg.view_inline(found["nine, each of a ninth of the light"])
