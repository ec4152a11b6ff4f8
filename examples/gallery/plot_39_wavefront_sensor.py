"""
A plenoptic camera as wavefront sensor
======================================

The wavefront before a main lens, from one raw image of a star on the corner of four lenslets.
"""

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import sense, wavefront_map

camera = lg.PlenopticCamera(
    wavelength="600 nm",
    object_distance="400 mm",
    main_lens={"focal_length": "200 mm"},
    lenslets={"pitch": "120 um", "count": (4, 4), "focal_length": "2.5 mm"},
    sensor={"pixel_pitch": "8 um"},
)
TRUE = {4: 0.07, 5: -0.08, 6: 0.05, 7: 0.06, 8: -0.05, 9: 0.04, 10: -0.03, 11: 0.02}  # waves rms
PHOTONS, BACKGROUND = 1e4, 0.01
aberrated = camera.replace(main_lens={"aberrations": TRUE})
star = lg.targets.points([(0.0, 0.0, 0.0)])
light = np.asarray(lg.simulate(aberrated, star, lg.Incoherent(1e-3)).data, np.float64)
raw = np.random.default_rng(1).poisson(PHOTONS * light / light.sum() + BACKGROUND).astype(np.float32)
found = sense(raw, camera, tuple(TRUE), exposure=Exposure(background=BACKGROUND, gain=1.0))
for term, deviation in zip(found.terms, found.deviations.ravel(), strict=True):
    print(f"Noll {term}: {found.coefficients[term]:+.4f} ± {deviation:.4f}, true {TRUE[term]:+.4f} waves rms")

# %%
# Each of the four lenslets shows the pupil by the light that falls on it, as behind a pyramid. Where the
# wavefront slopes, light leaves one picture of the pupil for another.

true = wavefront_map(TRUE)
left = found.phase() - true
span = max(np.nanmax(np.abs(true)), 1e-9)


def drawn(wavefront: np.ndarray) -> np.ndarray:
    """Between black and white for the true wavefront's largest values, grey outside of the pupil."""
    return np.nan_to_num(wavefront / span / 2 + 0.5, nan=0.5)


pictures = [(np.sqrt(raw / raw.max()), "raw image, square root")]
three = np.hstack([drawn(one) for one in (true, found.phase(), left)])
three[0, :2] = 0, 1  # a picture's darkest and brightest value are black and white
pictures += [(three, "wavefront: true, found, and their difference")]
figure = lg.plots.images(pictures, columns=2)

print(f"{2 * np.pi * np.nanstd(true):.2f} rad rms, {2 * np.pi * np.nanstd(left):.3f} rad rms left")

# %%
# Look at the wavefronts closely, true, found and their difference:

lg.view_inline(lg.Stack(np.stack([drawn(one) for one in (true, found.phase(), left)]).astype(np.float32)))
