"""Measures of an image: how good, how sharp, how much contrast.

- `signal`: `snr` and `rms_error` of an image against a reference
- `profiles`, `psf`: `first_zero`, `full_width`, `contrast`; `centroid`, `encircled_energy` of a point
- `transfer`, `slanted_edge`: `mtf` of a point image, its `cutoff`; the MTF across an edge, as in ISO 12233
- `chart` (`saddles`, `crossings`): corners, edges and distortion of a chessboard on a picture
- `pupil_edge`: directional resolution of lenslets, from the edges of micro-images
- `photon_transfer`: gain, noise, dark signal and full well of a sensor, by EMVA 1288
- `beams`: `beam_width`, `divergence`, `beam_quality` and degrees of coherence of light on a plane
"""

from lumigraph.analysis import psf
from lumigraph.analysis.beams import (
    beam_quality,
    beam_width,
    degree_of_coherence,
    divergence,
    overall_coherence,
)
from lumigraph.analysis.chart import Chart
from lumigraph.analysis.photon_transfer import photon_transfer
from lumigraph.analysis.profiles import contrast, first_zero, full_width
from lumigraph.analysis.psf import centroid, encircled_energy
from lumigraph.analysis.pupil_edge import pupil_edge
from lumigraph.analysis.signal import rms_error, snr
from lumigraph.analysis.slanted_edge import SlantedEdge, slanted_edge
from lumigraph.analysis.transfer import cutoff, mtf

__all__ = [
    "Chart",
    "SlantedEdge",
    "beam_quality",
    "beam_width",
    "centroid",
    "contrast",
    "cutoff",
    "degree_of_coherence",
    "divergence",
    "encircled_energy",
    "first_zero",
    "full_width",
    "mtf",
    "overall_coherence",
    "photon_transfer",
    "psf",
    "pupil_edge",
    "rms_error",
    "slanted_edge",
    "snr",
]


def __dir__() -> list[str]:
    return __all__
