"""Objects from raw images: what a camera must have seen, from a model of how it sees.

- `forward`: `ForwardModel`, what a deconvolution asks of a camera
"""

from lumigraph.deconvolution.forward import ForwardModel, PlacedModel

__all__ = ["ForwardModel", "PlacedModel"]
