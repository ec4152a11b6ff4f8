"""
What a sensor makes of light
============================

The variance of a pixel grows with its mean as the number of electrons does. From pairs of flat images and
one pair of dark ones, `lumigraph.analysis.photon_transfer` finds gain, read noise and full well, as EMVA
1288 does.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import um

rng = np.random.default_rng(1)
sensor = lg.Sensor((300, 300), 5 * um, full_well=12000, read_noise=6.0, bits=12, black_level=64)


def pair(light):
    """Two exposures of one even light."""
    return [sensor.expose(np.full(sensor.shape, light), photons=11000, rng=rng) for _ in range(2)]


lights = np.linspace(0.05, 1.2, 16)
found = lg.analysis.photon_transfer([pair(light) for light in lights], [pair(0.0)])
line = found.means / found.gain
figure = lg.plots.curves(
    found.means, {"measured": found.variances, "photon noise": line},
    xlabel="mean over the dark [counts]", ylabel="variance over the dark's [counts²]",
)  # fmt: skip
print(f"gain {found.gain:.3f} electrons per count (in truth {sensor.gain:.3f})")
print(f"noise in the dark {found.dark_noise:.2f} electrons (in truth {sensor.read_noise:.2f})")

# %%
# Measure a sensor of your own:
#
# .. code-block:: sh
#
#    lumigraph measure sensor a1.tiff a2.tiff b1.tiff b2.tiff --dark d1.tiff --dark d2.tiff
