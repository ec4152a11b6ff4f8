"""
A raw image of a camera 2.0, rendered at three depths
=====================================================

Each lenslet shows a part of the scene. Patches of the right size around their middles tile a picture; the
size decides which depth is sharp.
"""

import lumigraph as lg
from lumigraph.units import mm, nm, um

camera = lg.FocusedPlenopticCamera(
    wavelength=550 * nm,
    object_distance=120 * mm,
    main_lens={"focal_length": 60 * mm},
    lenslets={"pitch": 150 * um, "focal_length": 5.2 * mm, "count": (25, 25), "magnification": 0.5},
    sensor={"pixel_pitch": 6 * um},
)
grid, width = camera.object_grid, camera.object_grid.size[1]
near = lg.targets.siemens_star(grid, 12, 0.4 * width, (0.0, -0.24 * width)).at(-5 * mm)
far = lg.targets.siemens_star(grid, 10, 0.4 * width, (0.0, 0.24 * width)).at(6 * mm)
raw = lg.simulate(camera, near + far, lg.Incoherent(accuracy=1e-2))
pictures = [(raw.data, "raw image")]
for dz, name in ((-5 * mm, "5 mm nearer"), (0.0, "focused plane"), (6 * mm, "6 mm farther")):
    pictures.append((lg.render(raw, camera.calibration, camera.patch_at(dz), blend=True), name))
figure = lg.plots.images(pictures, columns=2)

# %%
# The size of the patch, measured lenslet by lenslet from how neighbours agree, makes both sharp at once.

found = lg.depth.correlation(raw, camera.calibration)
sharp = lg.render(raw, camera.calibration, found.values, blend=True)
both = lg.plots.images([(found.values, "patch of each lenslet [px]"), (sharp, "sharp all over")], columns=2)

# %%
# Play with it: pictures for every size of the patch, and the raw image.

lg.view_inline(raw, camera.calibration)
