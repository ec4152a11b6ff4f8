"""camera.operator: the forward model that deconvolution takes."""

import numpy as np
import pytest

import cameras
from lumigraph.core.linear import Linear, stack
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.units import mm, um


@pytest.fixture(scope="module")
def camera():
    return cameras.focused(count=(4, 3), pixel_pitch=9 * um)


@pytest.fixture(scope="module")
def volume(camera):
    return camera.operator((0.0, 2 * mm), 5, accuracy=1e-2)


def test_it_is_a_forward_model_of_the_arrays_field(camera, volume):
    plane = camera.operator(None, 5, accuracy=1e-2)
    assert isinstance(plane, Linear)
    assert plane.shape == (camera.sensor.shape, (20, 15))
    assert volume.shape == (camera.sensor.shape, (2, 20, 15))
    scale = camera.object_distance / camera.separation
    np.testing.assert_allclose(plane.object_grid.pitch, 100 * um * scale / 5)
    samples = plane.object_grid
    np.testing.assert_allclose([samples.y.sum(), samples.x.sum()], 0, atol=1e-12)  # centred on the axis


def test_samples_resolve_what_the_main_lens_does_unless_told(camera):
    pitch = camera.operator(accuracy=1e-2).object_grid.pitch[0]
    finest = camera.wavelength * camera.object_distance / (2 * camera.pupil_diameter)
    assert 0.7 * finest < pitch <= finest * (1 + 1e-9)


def test_depths_add_up(camera, volume, rng):
    intensity = rng.random(volume.shape[1]).astype(np.float32)
    planes = [camera.operator((dz,), 5, accuracy=1e-2) for dz in (0.0, 2 * mm)]
    parts = [plane.forward(intensity[k : k + 1]) for k, plane in enumerate(planes)]
    np.testing.assert_allclose(volume.forward(intensity), sum(parts), rtol=1e-5, atol=1e-6)
    many = stack([camera.operator(None, 5, accuracy=1e-2)], depths=(0.0,))
    np.testing.assert_allclose(many.forward(intensity[:1]), parts[0], rtol=1e-5, atol=1e-6)


def test_a_point_spread_function_is_the_image_of_one_sample(volume):
    point = np.zeros(volume.shape[1])
    point[1, 9, 8] = 1
    image = volume.psf((1, 9, 8))
    assert image.dtype == np.float32
    np.testing.assert_allclose(image, volume.forward(point), atol=1e-5 * image.max())
    # Upright: a sample above and left of another is seen above and left of it.
    places = [
        np.array(np.unravel_index(volume.psf((0, *at)).argmax(), image.shape)) for at in ((4, 4), (15, 10))
    ]
    assert (places[0] < places[1]).all()


def test_all_light_of_a_point_inside_arrives(camera):
    """Lenslets without gaps: a sample's area on the lenslets, (L/z)² of its own; some glare falls beyond."""
    wide = camera.replace(lenslets={"count": (9, 9)})
    operator = wide.operator(None, 5, accuracy=1e-2)
    area = np.prod(operator.object_grid.pitch) * (wide.separation / wide.object_distance) ** 2
    light = operator.psf((22, 22)).sum(dtype=float) * wide.sensor.pixel_pitch**2
    assert 0.97 < light / area < 1


def test_progress_goes_to_the_end(camera):
    seen = []
    camera.operator((1.23 * mm, -1.23 * mm), 3, accuracy=1e-2, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (((),), GeometryError, "depth"),
        (((-70 * mm,),), GeometryError, "focal|main lens|distance"),
        ((None, 0), GeometryError, "samples_per_lenslet"),
        ((None, 2.5), GeometryError, "samples_per_lenslet"),
    ],
)
def test_what_makes_no_sense_is_refused(camera, arguments, error, message):
    with pytest.raises(error, match=message):
        camera.operator(*arguments, accuracy=1e-2)


@pytest.mark.parametrize("accuracy", [0.1, 1e-6])
def test_an_accuracy_out_of_range_is_refused(camera, accuracy):
    with pytest.raises(SamplingError, match=f"accuracy is {accuracy:g} but must lie between 1e-05 and 0.01"):
        camera.operator(accuracy=accuracy)


def test_other_shapes_are_refused(volume):
    with pytest.raises(
        GeometryError, match=r"an object has shape \(20, 15\) but the operator takes \(2, 20, 15\)"
    ):
        volume.forward(np.ones((20, 15)))
    with pytest.raises(GeometryError, match=r"a raw image has shape \(3, 3\) but the operator takes"):
        volume.adjoint(np.ones((3, 3)))
