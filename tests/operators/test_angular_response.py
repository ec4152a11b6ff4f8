"""Pixels that respond to angles, and that are dark in part, beside plane waves and closed forms."""

import math

import numpy as np
import pytest
import scipy.fft

import lumigraph as lg
from lumigraph.operators.periodic import white
from lumigraph.operators.periodic.coherent import disc
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.resampling import averaged
from lumigraph.sensor import Sensor, integrate
from lumigraph.sensor.angular import AngularResponse
from lumigraph.units import deg, mm, nm, um

LENSLETS = {"pitch": 80 * um, "focal_length": 0.6 * mm, "magnification": 0.5}

STEP = 0.6 * um

ANGLES = {"angles": (0.0, 5 * deg, 10 * deg, 20 * deg), "values": (1.0, 0.9, 0.65, 0.3)}


def camera(*, pixels=None, count=(3, 3), model="paraxial", **lenslets):
    """A small 2.0 camera of f/8 lenslets: their light arrives at up to 4 degrees."""
    return lg.FocusedPlenopticCamera(
        wavelength=550 * nm, object_distance=120 * mm, main_lens={"focal_length": 60 * mm}, model=model,
        lenslets={**LENSLETS, "count": count, **lenslets},
        sensor={"pixel_pitch": 4 * um, **(pixels or {})},
    )  # fmt: skip


def apart(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


def behind(camera, light, source, goal):
    """Of light (y, x) in the lenslet plane, samples of both axes [m]: at `goal`, telecentric."""
    b, L = camera.lenslet_distance, camera.separation
    squared = camera.wavelength * b * L / (b + L)
    k = np.exp(1j * np.pi / squared * np.subtract.outer(goal, source) ** 2)
    return k @ light @ k.T


def by_plane_waves(camera, y, x, response):
    """Image of a point: each plane wave that arrives, found by a transform, times its amplitude."""
    L, b, wave = camera.separation, camera.lenslet_distance, camera.wavelength
    stop = lg.Grid.square(240, camera.pupil_diameter / 228)
    plane = lg.Grid.square(750, 0.4 * um)
    turn = np.exp(-2j * np.pi / (wave * L) * np.outer(plane.y, stop.y))
    moved = [np.exp(-2j * np.pi / wave * stop.y * at / camera.object_distance) for at in (y, x)]
    pupil = np.outer(*moved) * np.clip(
        (camera.pupil_diameter / 2 - np.hypot(stop.y[:, None], stop.x)) / stop.pitch[0] + 0.5, 0, 1
    )
    pupil = pupil * np.exp(1j * np.pi / wave * (1 / camera.object_distance + 1 / L - 1 / (60 * mm))
                           * (stop.y[:, None] ** 2 + stop.x**2))  # fmt: skip
    light = turn @ pupil @ turn.T * camera.lenslet_array().transmission(plane, wave)
    image = lg.Grid.square(720, STEP)
    field = behind(camera, light, plane.y, image.y)
    f = scipy.fft.fftfreq(720, STEP)  # telecentric: λ f is b_e/b times the tangent from the chief ray
    weight = np.sqrt(response.of(np.arctan(wave * f * L / (b + L))))
    field = scipy.fft.ifft2(scipy.fft.fft2(field) * np.outer(weight, weight))
    scale = 1 + b / L
    grid = lg.Grid(image.shape, (STEP * scale, STEP * scale))
    return averaged(grid, camera.sensor.grid).forward((np.abs(field) ** 2).astype(np.float32))


@pytest.mark.filterwarnings("ignore::lumigraph.errors.SamplingWarning")
def test_points_are_sums_of_plane_waves_each_by_its_angle():
    plain, seen = camera(), camera(pixels={"angular_response": ANGLES})
    response = seen.sensor.angular_response
    y, x = 20 * um, -35 * um
    scene = lg.targets.points([(y, x)])
    found = [lg.simulate(one, scene).data for one in (plain, seen)]
    expected = [by_plane_waves(plain, y, x, one) for one in (AngularResponse(), response)]
    factor = (found[0] * expected[0]).sum() / (expected[0] ** 2).sum()
    assert apart(found[0], expected[0] * factor) < 8e-4  # grey edges of the reference
    assert apart(found[1], expected[1] * factor) < 8e-4
    assert apart(found[1], found[0]) > 0.04


def white_by_waves(camera, response):
    """White image: each place in the stop sends a wave whose intensity is a product of both axes'."""
    L, b, wave = camera.separation, camera.lenslet_distance, camera.wavelength
    pitch, f = camera.lenslets.pitch, camera.lenslets.focal_length[0]
    at, weight = np.polynomial.legendre.leggauss(120)
    s, squared = (np.arange(720) - 359.5) * STEP, wave * b * L / (b + L)
    angles, place, shares = disc(160)

    def along(nodes):
        total = np.zeros((len(nodes), len(s)), complex)
        for k in (-1, 0, 1):
            w = (k + at / 2) * pitch
            aside = np.subtract.outer(s, w)
            spread = np.exp(1j * np.pi / squared * aside**2) * np.sqrt(response.of(np.arctan(aside / b)))
            light = weight * pitch / 2 * np.exp(-1j * np.pi / (wave * f) * (at * pitch / 2) ** 2)
            total += (np.exp(-2j * np.pi / (wave * L) * np.outer(nodes, w)) * light) @ spread.T
        return np.abs(total) ** 2 / squared

    stop, scale = camera.pupil_diameter / 2, 1 + b / L
    image = along(stop * np.sin(angles)).T @ shares @ along(stop * place) / scale**2
    grid = lg.Grid(image.shape, (STEP * scale, STEP * scale), (STEP * scale / 2, STEP * scale / 2))
    return averaged(grid, camera.sensor.grid).forward(image.astype(np.float32))


def test_white_images_are_sums_over_the_stop_each_wave_by_its_angles():
    plain, seen = camera(), camera(pixels={"angular_response": ANGLES})
    expected = white_by_waves(plain, seen.sensor.angular_response)
    found, stated = white.image_and_error(seen, 1e-2)
    assert apart(found, expected) < min(2e-3, stated)  # waves all taken as along the axis: 1.1e-2
    assert apart(white.white_image(plain, 1e-2), expected) > 0.05


@pytest.mark.long
def test_an_even_plane_and_the_white_image_are_alike():
    seen = camera(pixels={"angular_response": ANGLES, "pixel_pitch": 8 * um}, count=(1, 1))
    grid = lg.Grid.square(120, seen.object_grid.pitch[0])
    found = seen.operator_on(grid, accuracy=1e-2).forward(np.ones(grid.shape, np.float32))
    assert apart(found, white.white_image(seen, 1e-2)) < 1e-2
    assert apart(found, white.white_image(camera(pixels={"pixel_pitch": 8 * um}, count=(1, 1)), 1e-2)) > 0.05


def test_a_flat_response_and_full_pixels_change_no_bit():
    flat = {"angles": (0.0, 30 * deg), "values": (1.0, 1.0)}
    plain, seen = camera(), camera(pixels={"angular_response": flat, "fill_factor": 1.0})
    assert Optics.of(plain, 0.12, 1e-3).key == Optics.of(seen, 0.12, 1e-3).key
    scene = lg.targets.points([(20 * um, -35 * um)])
    for scene in (lg.targets.points([(20 * um, -35 * um)]), lg.Scene([lg.scene.Diffuser()])):
        assert np.array_equal(*(lg.simulate(one, scene).data for one in (plain, seen)))


@pytest.mark.parametrize("fill", [1.0, 0.6])
def test_pixels_that_are_dark_in_part_pass_a_wave_by_the_sinc_of_their_active_width(fill):
    frequency, pitch = 60e3, 5 * um
    sensor, plane = Sensor((1, 41), pitch, fill_factor=fill), lg.Grid((64, 512), (1 * um, 1 * um))
    wave = np.broadcast_to(1 + np.cos(2 * np.pi * frequency * plane.x), plane.shape).astype(np.float32)
    there = np.cos(2 * np.pi * frequency * sensor.grid.x)
    expected = fill**2 * (
        1 + math.sin(math.pi * fill * pitch * frequency) / (math.pi * fill * pitch * frequency) * there
    )
    found = averaged(plane, sensor.grid, sensor.fill_factor).forward(wave)[0]
    np.testing.assert_allclose(found, expected, atol=2e-3 * fill**2)
    frequency = 30 / (512 * um)  # whole periods in the window, whose series is integrated
    wave = np.broadcast_to(1 + np.cos(2 * np.pi * frequency * plane.x), plane.shape)
    expected = fill**2 * (
        1 + np.sinc(fill * pitch * frequency) * np.cos(2 * np.pi * frequency * sensor.grid.x)
    )
    np.testing.assert_allclose(integrate(wave, plane, sensor)[0], expected, atol=1e-12)


def test_where_pixels_angles_are_not_followed_they_are_refused():
    seen = camera(pixels={"angular_response": {"power": 4.0}})
    with pytest.raises(lg.GeometryError, match=r"coherence is Snapshots, which counts .* Use Incoherent"):
        lg.simulate(seen, lg.targets.points([(0, 0)]), lg.Snapshots(2))
    with pytest.raises(
        lg.GeometryError, match=r"angular_response is followed behind .* not in cameras without"
    ):
        lg.SingleLensCamera(
            wavelength=550 * nm, object_distance=120 * mm,
            main_lens={"focal_length": 60 * mm, "diameter": 5 * mm},
            sensor={"pixel_pitch": 5 * um, "shape": (9, 9), "angular_response": {"power": 4.0}},
        )  # fmt: skip
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
    with pytest.raises(lg.GeometryError, match="not in microscopes"):
        scope.replace(sensor={"angular_response": {"power": 4.0}})
    with pytest.raises(lg.GeometryError, match="1 angles and 1 values"):
        AngularResponse(0.0, (0.0,), (1.0,))
    with pytest.raises(lg.GeometryError, match="angles are 0, 10, 5 deg but must rise from 0"):
        AngularResponse(0.0, (0.0, 10 * deg, 5 * deg), (1.0, 1.0, 1.0))


def test_a_camera_file_holds_them(tmp_path):
    told = camera(pixels={"angular_response": ANGLES, "fill_factor": 0.8})
    path = tmp_path / "camera.toml"
    path.write_text(told.to_toml(), encoding="utf-8")
    assert lg.FocusedPlenopticCamera.from_toml(path) == told
    path.write_text(path.read_text().replace(f'"{5 * deg!r} rad"', "5"), encoding="utf-8")
    with pytest.raises(lg.FormatError, match=r"sensor.angular_response.*has no unit"):
        lg.FocusedPlenopticCamera.from_toml(path)
