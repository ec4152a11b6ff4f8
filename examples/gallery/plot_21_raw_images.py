"""
What plenoptic cameras record
=============================

The same star before three cameras. Lenslets on the main lens' image (1.0) each show the main lens. Behind
it (2.0, Keplerian) they show small pictures that are turned, before it (Galilean) upright ones.
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um

optics = {"wavelength": 550 * nm, "object_distance": 120 * mm, "main_lens": {"focal_length": 60 * mm}}
lenslets = {"pitch": 120 * um, "focal_length": 4 * mm, "count": (15, 15)}
pixels = {"pixel_pitch": 5 * um}
cameras = {
    "1.0": lg.PlenopticCamera(**optics, lenslets=lenslets, sensor=pixels),
    "2.0, Keplerian": lg.FocusedPlenopticCamera(
        **optics, lenslets=lenslets | {"magnification": 0.5}, sensor=pixels
    ),
    "2.0, Galilean": lg.FocusedPlenopticCamera(
        **optics, lenslets=lenslets | {"magnification": -0.35}, sensor=pixels
    ),
}
light = lg.Incoherent(accuracy=1e-2)
raws = {
    name: lg.simulate(camera, lg.targets.siemens_star(camera.object_grid, 10), light)
    for name, camera in cameras.items()
}
figure = lg.plots.images([(raw.data, name) for name, raw in raws.items()], columns=3)

# %%
# Zoom into the Keplerian one, with its lattice over it:

name = "2.0, Keplerian"
lg.view_inline(raws[name], cameras[name].calibration)
