"""
Sharpness from a slanted edge
=============================

`lumigraph.analysis.slanted_edge` measures the transfer function of any picture by ISO 12233. Of a simulated
lens it finds, to a few hundredths, what theory says: the lens' own transfer times that of the pixels.
"""

import numpy as np

import lumigraph as lg
from lumigraph.units import mm, nm, um

wavelength, pixel, distance, diameter = 550 * nm, 4 * um, 200 * mm, 6 * mm
camera = lg.SingleLensCamera(
    wavelength=wavelength,
    object_distance=distance,
    main_lens={"focal_length": 100 * mm, "diameter": diameter},
    sensor={"pixel_pitch": pixel, "shape": [160, 160]},
)
raw = lg.simulate(camera, lg.targets.slanted_edge(camera.object_grid))
found = lg.analysis.slanted_edge(raw.data, pixel)

cutoff = diameter / (wavelength * distance)
f = np.linspace(0, cutoff, 200)
theory = 2 / np.pi * (np.arccos(f / cutoff) - f / cutoff * np.sqrt(1 - (f / cutoff) ** 2))
shown = found.frequencies <= cutoff
figure = lg.plots.curves(
    f / 1e3,
    {
        "a round lens, by theory": theory,
        "and pixels of 4 µm": theory * np.sinc(f * pixel),
        "measured on the edge": (found.frequencies[shown] / 1e3, found.mtf[shown]),
    },
    xlabel="line pairs per mm", ylabel="contrast", marks={"Nyquist": 1 / (2 * pixel) / 1e3},
)  # fmt: skip
edge = lg.plots.show(raw)

# %%
# Measure a picture of your own:
#
# .. code-block:: sh
#
#    lumigraph measure edge picture.tiff --region "100:180, 40:120" --pixel-pitch "5 um"
