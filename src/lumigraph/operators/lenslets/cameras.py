"""Sampling of points' images before a camera: with lenslets, paraxial or exact, or without."""

from lumigraph.operators.lenslets.exact_camera import ExactSampledCamera
from lumigraph.operators.lenslets.no_lenslets import FilmCamera
from lumigraph.operators.lenslets.sampled_camera import SampledCamera
from lumigraph.operators.sampling.camera import CameraOptics


def sampled(camera: CameraOptics) -> type[SampledCamera]:
    """Kind of sampling that a camera's images of points need."""
    if camera.array is None:
        return FilmCamera
    return ExactSampledCamera if camera.model == "exact" else SampledCamera
