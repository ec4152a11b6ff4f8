"""Measures of an image: how good, how sharp, how much contrast.

- `signal`: `snr` and `rms_error` of an image against a reference
- `profiles`: `first_zero`, `full_width` and `contrast` of a profile
- `transfer`: `mtf` of a point image, and its `cutoff`
- `psf`: `centroid` and `encircled_energy` of a point image
"""

from lumigraph.analysis import psf
from lumigraph.analysis.profiles import contrast, first_zero, full_width
from lumigraph.analysis.psf import centroid, encircled_energy
from lumigraph.analysis.signal import rms_error, snr
from lumigraph.analysis.transfer import cutoff, mtf

__all__ = [
    "centroid",
    "contrast",
    "cutoff",
    "encircled_energy",
    "first_zero",
    "full_width",
    "mtf",
    "psf",
    "rms_error",
    "snr",
]
