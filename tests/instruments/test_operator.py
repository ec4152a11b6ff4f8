"""camera.operator: the forward model that deconvolution takes."""

import numpy as np
import pytest

import cameras
from lumigraph.core.linear import Linear, stack
from lumigraph.errors import GeometryError, LumigraphError, SamplingError
from lumigraph.instruments import load_camera
from lumigraph.operators import periodic_operator
from lumigraph.sensor import Sensor
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


INSTRUMENTS = {
    "single": lambda: load_camera("thesis-2f").replace(sensor={"shape": (40, 50)}),
    "focused": lambda: cameras.focused(count=(4, 3), pixel_pitch=9 * um),
    "microscope": lambda: load_camera("lfm-worm").replace(
        lenslets={"count": (5, 5)}, objective={"model": "scalar"}
    ),
    "fourier": lambda: load_camera("lfm-fourier"),
}  # fmt: skip


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_every_instrument_has_one_signature(name, tmp_path):
    """None is a plane (y, x), a sequence a volume (z, y, x) whose slice at 0 is that plane."""
    instrument, seen = INSTRUMENTS[name](), []
    options = {"accuracy": 1e-2, "pixels": None, "folder": tmp_path, "progress": seen.append}
    plane = instrument.operator(None, None, **options)
    volume = instrument.operator((0.0,), None, **options)
    assert isinstance(plane, Linear)
    assert plane.shape[1] == plane.object_grid.shape
    assert volume.shape == (plane.shape[0], (1, *plane.shape[1]))
    assert plane.depths is None
    assert volume.depths == (0.0,)
    picture = np.random.default_rng(1).random(plane.shape[1]).astype(np.float32)
    image = plane.forward(picture)
    np.testing.assert_allclose(volume.forward(picture[None]), image, rtol=1e-6)
    np.testing.assert_allclose(volume.adjoint(image)[0], plane.adjoint(image), rtol=1e-6)
    assert all(0 < fraction <= 1 for fraction in seen)
    if seen:
        assert seen[-1] == 1
    if name in ("focused", "microscope"):
        assert any(tmp_path.iterdir())


def test_another_sensor_takes_the_place_of_the_cameras(camera):
    """Pixels three times as large, the middle one on the axis: each is the mean of nine."""
    fine = Sensor((63, 63), 3 * um)
    coarse = Sensor((21, 21), 9 * um)
    images = [camera.operator(None, 5, accuracy=1e-2, pixels=s) for s in (fine, coarse)]
    star = np.random.default_rng(2).random(images[0].shape[1]).astype(np.float32)
    one, other = (operator.forward(star) for operator in images)
    np.testing.assert_allclose(one.reshape(21, 3, 21, 3).mean((1, 3)), other, atol=2e-3 * other.max())


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("single", {"samples_per_lenslet": 3}, "no lenslets to count by"),
        ("single", {"accuracy": 1e-5}, "accuracy is 1e-05 but a single lens is imaged to 0.0001"),
        ("focused", {"pixels": 7}, "pixels is of type int but must be a Sensor"),
        ("microscope", {"accuracy": 0.0}, "accuracy is 0"),
        ("microscope", {"accuracy": np.nan}, "accuracy is nan"),
    ],
)
def test_what_an_instrument_cannot_do_is_refused(name, arguments, message):
    with pytest.raises(LumigraphError, match=message):
        INSTRUMENTS[name]().operator(None, **arguments)


def test_optics_are_plain_values(camera):
    """An operator of the values is that of the camera, which is not asked again."""
    optics = camera.optics()
    assert optics.optics() is optics
    assert hash(optics) == hash(camera.optics())
    grid = camera.object_grid
    np.testing.assert_array_equal(
        periodic_operator(optics, grid, accuracy=1e-2).forward(np.ones(grid.shape, np.float32)),
        periodic_operator(camera, grid, accuracy=1e-2).forward(np.ones(grid.shape, np.float32)),
    )
