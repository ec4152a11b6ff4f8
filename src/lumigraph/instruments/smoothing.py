"""Low-pass that keeps lenslet-shaped artefacts out of deconvolved objects."""

from lumigraph.core.linear import Linear
from lumigraph.deconvolution import LowPass
from lumigraph.deconvolution.filters import widths_of
from lumigraph.instruments.capabilities import WithObjective


def low_pass_of(camera: object, operator: Linear) -> LowPass | None:
    """The low-pass of a camera's operator; None for cameras whose objects do not show their lenslets."""
    if not isinstance(camera, WithObjective):
        return None
    assert operator.depths is not None  # a camera's operators stand somewhere
    assert operator.object_grid is not None
    distances = camera.low_pass_distances(operator.depths)
    return LowPass(widths_of(distances, operator.object_grid.pitch[0]))
