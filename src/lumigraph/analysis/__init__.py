"""Measures of an image: how good, how sharp, how much contrast.

- `signal`: `snr` and `rms_error` of an image against a reference
- `profiles`: `first_zero`, `full_width` and `contrast` of a profile
- `transfer`: `mtf` of a point image, and its `cutoff`
- `slanted_edge`: the MTF across an edge in a picture, as ISO 12233 measures it
- `chart`: corners, edges and distortion of a chessboard on a picture, by `saddles` of the brightness
- `crossings`: where the edges of saddles cross, which samples do not pull
- `pupil_edge`: how many directions lenslets tell apart, from the edges of micro-images
- `photon_transfer`: gain, noise, dark signal and full well of a sensor, by EMVA 1288
- `beams`: `beam_width`, `divergence`, `beam_quality` and degrees of coherence of light on a plane
- `psf`: `centroid` and `encircled_energy` of a point image
"""

from lumigraph.analysis import psf
from lumigraph.analysis.beams import (
    beam_quality,
    beam_width,
    degree_of_coherence,
    divergence,
    overall_coherence,
)
from lumigraph.analysis.chart import Chart, find_chart
from lumigraph.analysis.photon_transfer import PhotonTransfer, photon_transfer
from lumigraph.analysis.profiles import contrast, first_zero, full_width
from lumigraph.analysis.psf import centroid, encircled_energy
from lumigraph.analysis.pupil_edge import PupilEdge, pupil_edge
from lumigraph.analysis.signal import rms_error, snr
from lumigraph.analysis.slanted_edge import SlantedEdge, slanted_edge
from lumigraph.analysis.transfer import cutoff, mtf

__all__ = [
    "Chart",
    "PhotonTransfer",
    "PupilEdge",
    "SlantedEdge",
    "beam_quality",
    "beam_width",
    "centroid",
    "contrast",
    "cutoff",
    "degree_of_coherence",
    "divergence",
    "encircled_energy",
    "find_chart",
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
