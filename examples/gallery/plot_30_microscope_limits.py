"""
What a light-field microscope can resolve
=========================================

Close to the focused plane there is one sample per lenslet. Beyond it directions fill the gaps, and farther
still the lenslets' own diffraction takes over.
"""

import numpy as np

import lumigraph as lg
from lumigraph.design import microscope
from lumigraph.units import nm, um

wavelength, magnification, pitch, aperture = 525 * nm, 20, 125 * um, (0.5, 1.0)
depths = np.linspace(0, 150, 151) * um
spacing = [microscope.sampling_distance(wavelength, aperture, pitch / magnification, z) for z in depths]
far = depths[depths >= microscope.near_field(wavelength, magnification, pitch)]
period = [1 / microscope.band_limit(wavelength, magnification, pitch, z) for z in far]
figure = lg.plots.curves(
    depths / um,
    {
        "distance between samples": np.array(spacing) / um,
        "finest period that a lenslet passes": (far / um, np.array(period) / um),
    },
    xlabel="depth [µm]", ylabel="at the object [µm]",
)  # fmt: skip
print(lg.LightFieldMicroscope.from_catalogue("lfm-worm").describe())

# %%
# Play with it:
#
# .. code-block:: sh
#
#    lumigraph design lfm-worm --web
