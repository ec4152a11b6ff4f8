"""Benches of light-field microscopes, and pictures beside predicted ones."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import GeometryError
from lumigraph.metrology.alignment.matching import growing, matched
from lumigraph.metrology.alignment.setup import STATES
from lumigraph.metrology.alignment.stood import white_of


@pytest.fixture(scope="module")
def scope():
    return lg.LightFieldMicroscope(
        wavelength="550 nm", objective={"magnification": 20.0, "numerical_aperture": 0.4},
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": (13, 13)},
        sensor={"pixel_pitch": "6.5 um", "black_level": 64},
    )  # fmt: skip


@pytest.fixture(scope="module")
def reader(scope):
    return lg.metrology.WhiteReader(lg.metrology.white_camera(scope))


def state(**values):
    return np.array([values.get(one, 0.0) for one in STATES])


def test_white_images_of_a_microscope_are_those_of_its_volume_operator(scope):
    """An evenly lit pupil on one side, points of an even plane of fluorescence on the other."""
    low = scope.replace(
        objective={"magnification": 5.0, "numerical_aperture": 0.1}, lenslets={"count": (7, 7)}
    )
    operator = low.operator((0.0,), 9, accuracy=1e-2)
    plane = operator.forward(np.ones(operator.shape[1], np.float32)).reshape(low.sensor.shape)
    light = white_of(lg.metrology.white_camera(low), state())
    middle = tuple(slice(n // 2 - 9, n // 2 + 10) for n in light.shape)
    one, other = (image[middle] / image[middle].mean() for image in (light, plane))
    assert np.sqrt(np.mean((one - other) ** 2)) < 0.02


def test_heights_and_tilts_of_a_microscope_s_array_are_read_from_the_widths_of_micro_images(reader):
    true = state(height=3e-5, tilt_y=4e-3, tilt_x=-6e-3, shift_x=4e-6, turn=2e-3)
    light = white_of(reader.camera, true, around=1e-4)
    picture = 3e4 * (light / light.max() + 0.005 * np.random.default_rng(1).standard_normal(light.shape)) + 64
    first = reader.read(picture)
    found = reader.matched(picture, first, true * 0.95)
    off = found.values - reader.rays.measures(true)
    assert found.matched
    assert first.errors[9] > 1  # one picture alone does not show how widths grow
    assert off[:4] == pytest.approx(0, abs=2e-4)  # px
    assert off[4:6] == pytest.approx(0, abs=2e-3)
    reach = reader.rays.reach * reader.rays.lengths[2]
    assert np.abs(off[9:] / found.errors[9:]).max() < 3.5
    assert found.errors[9:].max() * reader.rays.lengths[1] / reach < 3e-4  # rad, of 4e-3 and 6e-3


@pytest.mark.long
def test_a_microscope_s_bench_is_aligned(scope, reader):
    """Height and tilt from pictures, with the aperture known to 0.05 %."""
    pytest.importorskip("pymmcore_plus", reason="pymmcore-plus is not installed")
    from lumigraph.metrology.alignment.setup import setup_of
    from lumigraph.metrology.alignment.simulated import simulated
    from lumigraph.metrology.alignment.unicore import simulated_devices

    angle = {"unit": "0.001 deg", "step": "0.001 deg", "limits": ["-3 deg", "3 deg"], "sign": 1}
    motors = [
        {"moves": "height", "device": "Z", "step": "0.1 um", "sign": 1, "limits": ["-1 mm", "1 mm"]},
        {"moves": "tilt_x", "device": "T", **angle},
    ]
    options = {
        "out": {"height": "50 um", "tilt_x": "0.5 deg"}, "signs": {"height": 1, "tilt_x": 1}, "noise": 0.005
    }  # fmt: skip
    setup = setup_of({"motor": motors, "known": {"aperture": 5e-4}, "simulated": options})
    made = simulated(setup, scope)
    (*_, last) = lg.metrology.align(simulated_devices(setup, made), reader)
    assert last.status == "aligned"
    truth = made.truth()
    assert truth["height"] == pytest.approx(0, abs=5e-6)
    assert truth["tilt_x"] == pytest.approx(0, abs=3.5e-4)


def test_benches_need_micro_images_on_a_lattice():
    with pytest.raises(GeometryError, match="Fourier microscope has no white images of micro-images"):
        lg.metrology.white_camera(lg.load_camera("lfm-fourier"))
    with pytest.raises(GeometryError, match=r"cannot be aligned\. Give a plenoptic camera"):
        lg.metrology.white_camera(lg.load_camera("thesis-2f"))


def discs(centers, radii, size):
    y, x = np.mgrid[:size, :size]
    return sum(
        1 / (1 + np.exp((np.hypot(y - cy, x - cx) - r) / 0.8))
        for (cy, cx), r in zip(centers, radii, strict=True)
    )


def test_displacements_and_widenings_are_those_of_the_micro_images():
    rng = np.random.default_rng(2)
    centers = np.stack(np.meshgrid(*2 * [20.3 + 21.7 * np.arange(6)], indexing="ij"), -1).reshape(-1, 2)
    moved, wider = rng.uniform(-0.05, 0.05, centers.shape), rng.uniform(-0.01, 0.01, len(centers))
    predicted = discs(centers, np.full(len(centers), 7.0), 160)
    image = 30 * discs(centers + moved, 7.0 * (1 + wider), 160)
    found = matched(image, predicted, centers, 9)
    assert found.near
    assert found.displacement == pytest.approx(moved, abs=2e-3)
    assert found.widening == pytest.approx(wider, abs=1e-3)
    assert not matched(30 * discs(centers + 3, np.full(36, 7.0), 160), predicted, centers, 9).near


def test_the_growth_of_a_widening_has_the_error_of_its_scatter():
    rng = np.random.default_rng(4)
    places = rng.uniform(-1, 1, (400, 2))
    fits = [
        growing(places, places @ [0.02, -0.03] + 0.01 + 1e-3 * rng.standard_normal(400)) for _ in range(60)
    ]
    slopes, errors = np.array([one for one, _ in fits]), np.array([two for _, two in fits])
    assert slopes.mean(0) == pytest.approx([0.02, -0.03], abs=5e-5)
    assert slopes.std(0) == pytest.approx(errors.mean(0), rel=0.3)
