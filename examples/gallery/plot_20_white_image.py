"""
Where the micro-images stand
============================

A white image shows one bright disc behind each lenslet. `lumigraph.calibrate` finds their lattice, and how
far each disc is from it: here on a sensor that is turned by half a degree.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import deg, mm, nm, um

camera = lg.PlenopticCamera(
    wavelength=550 * nm,
    object_distance=200 * mm,
    main_lens={"focal_length": 100 * mm},
    lenslets={"pitch": 100 * um, "focal_length": 3.6 * mm, "count": (31, 31), "rotation": 0.5 * deg},
    sensor={"pixel_pitch": 6 * um},
)
light = lg.simulate(camera, lg.targets.white())
white = camera.sensor.expose(light.data, rng=np.random.default_rng(1))
calibration = lg.calibrate(white)
figure = lg.plots.lattice(white, calibration)
print(calibration.report())

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph samples make -o samples
#    lumigraph calibrate samples/bench-white.tiff --overlay lattice.png -o calibration.toml
#    lumigraph view samples/bench-raw.tiff --white samples/bench-white.tiff
