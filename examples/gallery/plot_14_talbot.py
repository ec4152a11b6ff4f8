"""
Talbot's carpet
===============

Behind a grating its own image comes back, without any lens: shifted by half a period at p²/λ, in place at
2p²/λ. Between them stand images of finer gratings.
"""

import warnings

import numpy as np

import lumigraph as lg
from lumigraph.units import nm, um

period, wavelength = 200 * um, 633 * nm
grid = lg.Grid((1, 1200), (2 * um, 2 * um))
slits = lg.Field((grid.x % period < period / 4)[None] + 0j, grid, wavelength)
talbot = 2 * period**2 / wavelength

# %%
# Each row of the carpet is one distance. The window holds twelve whole periods and is not padded: the light
# that leaves it comes back on the other side, as from the next periods of an endless grating. The warnings
# of that are wanted here.

with warnings.catch_warnings():
    warnings.simplefilter("ignore", lg.SamplingWarning)
    waves = [lg.propagate(slits, z, "angular_spectrum", pad=0) for z in np.linspace(0, talbot, 500)]
carpet = np.stack([wave.intensity[0, 300:900] for wave in waves])
figure = lg.plots.images([(carpet.clip(0, 1.5), f"0 to {talbot:.3g} m, from the top down")], columns=1)

# %%
# Look closely:

lg.view_inline(lg.RawImage(carpet.astype(np.float32), 2 * um))
