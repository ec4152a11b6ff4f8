"""Expected errors of linear reconstructions beside Wiener's formula, dense inverses, and drawn scenes."""

import math

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import FormatError, GeometryError
from lumigraph.studies.information import Light, Scenes, reconstruction_error
from lumigraph.studies.information.imaging import imaging
from lumigraph.studies.information.points import source
from lumigraph.studies.information.scenes import coloured, frequencies

UM = 1e-6
PURE = {"read_noise": 0.0, "full_well": 60_000, "bits": 16}


def plain(pixel=3.0, **sensor):
    """A single lens whose finest period is 12 µm, in the object too."""
    return lg.SingleLensCamera(
        wavelength="600 nm", object_distance="120 mm",
        main_lens={"focal_length": "60 mm", "diameter": "6 mm"},
        sensor={"pixel_pitch": pixel * UM, "shape": (301, 301), **PURE, **sensor},
    )  # fmt: skip


def small(**changes):
    """A camera 2.0 of few large pixels."""
    camera = lg.load_camera("thesis-plenoptic-2-m050")
    return camera.replace(sensor={"pixel_pitch": 20 * UM, "shape": None}, **changes)


def wiener(scenes, photons, pixel, read, finest):
    """(n, n): what is left of each wave of an endless plane in focus, by lens and pixels."""
    at = frequencies(scenes.samples) / scenes.size
    one = np.fft.fftfreq(scenes.samples, scenes.pitch)
    part = np.minimum(at * finest, 1)
    lens = 2 / math.pi * (np.arccos(part) - part * np.sqrt(1 - part**2))
    pixels = np.sinc(one[:, None] * pixel) * np.sinc(one * pixel)
    electrons = photons * (pixel / scenes.pitch) ** 2
    told = (electrons * lens * pixels) ** 2 / (electrons + read**2) * (scenes.size / pixel) ** 2
    return scenes.power / (1 + scenes.power * told)


@pytest.mark.parametrize(("photons", "read"), [(300, 0.0), (3000, 4.0), (10_000, 0.0)])
def test_before_one_lens_it_is_wieners_formula(photons, read):
    """The border of a scene is known: 1 to 2 % for a square 43 finest periods wide, 3 % for half of it."""
    scenes = Scenes(8 * UM, 64)
    camera = plain(2.0, read_noise=read)
    found = reconstruction_error(camera, [0.0], scenes, Light(photons))
    noise = math.hypot(read, camera.sensor.gain / math.sqrt(12))
    left = wiener(scenes, photons, 2 * UM, noise, 12 * UM)
    left[0, 0] = 0
    assert found.value == pytest.approx(math.sqrt(left.sum()) / scenes.contrast, rel=0.025)
    one = [np.sqrt(left / scenes.power)[0, k] for k in (4, 12, 24)]
    assert found.over_frequency[0, [3, 11, 23]] == pytest.approx(one, rel=0.08)


@pytest.mark.filterwarnings("ignore:the brightest pixel")
def test_without_noise_nothing_is_left_that_the_lens_lets_through_and_without_light_all():
    scenes = Scenes(15 * UM, 16)  # no wave is finer than 21 µm
    assert reconstruction_error(plain(), [0.0], scenes, Light(1e9)).value < 0.01
    assert reconstruction_error(plain(), [0.0], scenes, Light(1e-3)).value == pytest.approx(1, abs=1e-3)
    finer = Scenes(4 * UM, 48)
    at, cut = frequencies(48) / finer.size, 1 / (12 * UM)
    beyond = finer.power[at > cut].sum() / finer.contrast**2
    found = reconstruction_error(plain(2.0), [0.0], finer, Light(1e5)).value
    assert 0.8 < found**2 / beyond < 1.05  # its border being known tells a little


def dense(seen, scenes):
    """(nz, n, n): what is left of each wave, from the whole matrix and its inverse."""
    shape = (seen.planes, scenes.samples, scenes.samples)
    size = math.prod(shape)
    each = np.eye(size).reshape(size, *shape)
    roots = coloured(each, scenes.power)
    images = np.stack([seen.electrons(one).ravel() for one in roots]) / seen.noise.ravel()
    root = roots.reshape(size, size)
    left = root @ np.linalg.inv(np.eye(size) + images @ images.T) @ root.T
    waves = np.fft.fft2(each).reshape(size, size) / scenes.samples
    found = np.einsum("if,ij,jf->f", waves.conj(), left, waves).real.reshape(shape) / scenes.samples**2
    found[:, 0, 0] = 0
    return found


@pytest.mark.parametrize("depths", [[3e-3], pytest.param([-4e-3, 4e-3], marks=pytest.mark.long)])
def test_before_lenslets_it_is_the_inverse_of_the_whole_matrix(depths):
    scenes = Scenes(60 * UM, 8)
    seen = imaging(small(), np.array(depths), scenes, Light(2e3), 1e-2)
    left = dense(seen, scenes).sum((1, 2))
    found = reconstruction_error(small(), depths, scenes, Light(2e3), volume=True)
    assert found.value == pytest.approx(
        math.sqrt(left.mean()) / scenes.contrast, rel=3 * found.uncertain + 1e-3
    )
    assert found.uncertain < 0.02
    assert found.errors == pytest.approx(np.sqrt(left) / scenes.contrast, rel=0.08)


@pytest.mark.long
def test_scenes_at_once_are_harder_than_one_after_the_other():
    scenes = Scenes(60 * UM, 8)
    alone, at_once = (
        reconstruction_error(small(), [-4e-3, 4e-3], scenes, Light(2e3), volume=v).value
        for v in (False, True)
    )
    assert at_once > 1.1 * alone


@pytest.mark.parametrize(("camera", "pitch"), [(plain(2.0, read_noise=2.0), 20 * UM), (small(), 40 * UM)])
def test_finer_samples_of_the_same_scenes_change_nothing(camera, pitch):
    powers = tuple(1 / k**2 if k <= 7 else 0.0 for k in range(1, 40))
    coarse = reconstruction_error(camera, [2e-3], Scenes(pitch, 16, 0.3, powers), Light(4000))
    fine = reconstruction_error(camera, [2e-3], Scenes(pitch / 2, 32, 0.3, powers), Light(1000))
    assert fine.value == pytest.approx(coarse.value, rel=2 * (fine.uncertain + coarse.uncertain))
    assert coarse.brightest == pytest.approx(fine.brightest, rel=1e-2)


@pytest.mark.parametrize(
    ("camera", "pitch", "dz"),
    [(plain(), 6 * UM, 1e-3), (small(), 30 * UM, 4e-3), (lg.load_camera("lfm-fourier"), 2 * UM, 3 * UM)],
)
def test_a_scenes_light_is_that_of_its_points(camera, pitch, dz):
    """What pixels catch of a sample in the middle, beside `bounds`' image of a point of as many photons."""
    scenes = Scenes(pitch, 15)
    seen = imaging(camera, np.array([dz]), scenes, Light(1000), 1e-2)
    one = np.zeros((1, 15, 15))
    one[0, 7, 7] = 1
    point = source(camera, np.array([dz]), 1e-2).image(np.array([0.0, 0.0, dz]))
    electrons = 1000 * camera.sensor.quantum_efficiency
    assert seen.electrons(one).sum() == pytest.approx(electrons * point.sum(), rel=0.02)


@pytest.mark.parametrize("volume", [False, pytest.param(True, marks=pytest.mark.long)])
def test_reconstructions_of_drawn_scenes_err_as_expected(volume):
    scenes = Scenes(60 * UM, 8)
    case = small(), [-3e-3, 3e-3] if volume else [3e-3], scenes, Light(2e3)
    found = reconstruction_error(*case, volume=volume)
    some = lg.information.reconstruction_trials(*case, draws=16, volume=volume, rng=np.random.default_rng(5))
    off = math.hypot(some.rms_error, found.uncertain * found.value)
    assert some.rms == pytest.approx(found.value, abs=3 * off)
    assert off < 0.06 * found.value


def test_the_power_of_drawn_pictures_is_found_again():
    """Fading borders mix neighbouring waves; their longest have the fewest squares."""
    rng, true = np.random.default_rng(2), Scenes(1 * UM, 128, 0.2)
    found = Scenes.of([np.maximum(true.drawn(rng), 0) for _ in range(12)], 1 * UM, 32)
    fine = found.power[0, 3:14] / found.power[0, 8]
    assert fine == pytest.approx((8 / np.arange(3, 14)) ** 2, rel=0.2)
    assert found.contrast < true.contrast  # waves longer than a square are not its own


def refused(match, error=GeometryError):
    return pytest.raises(error, match=match)


def test_nonsense_is_refused():
    with refused("nan"):
        Scenes(math.nan)
    with refused("samples of scenes are 1000 but"):
        Scenes(UM, 1000)
    with refused("spectrum has 3 powers but"):
        Scenes(UM, 32, 0.3, (1.0, 1.0, 1.0))
    with refused("at least 0"):
        Scenes(UM, 8, 0.3, (-1.0,) * 6)
    with refused(r"shape \(20, 20\)", FormatError):
        Scenes.of([np.ones((20, 20))], UM)
    with refused("no contrast", FormatError):
        Scenes.of([np.ones((40, 40))], UM)
    with refused("is dark", FormatError):
        Scenes.of([np.zeros((40, 40))], UM)
    with refused("NaN|nan|finite", FormatError):
        Scenes.of([np.full((40, 40), math.nan)], UM)
    with refused("scenes are 64000 µm wide but the field of view is"):
        reconstruction_error(plain(), [0.0], Scenes(2e-3, 32))
    with refused("the microscope's pixels see"):
        reconstruction_error(lg.load_camera("lfm-fourier"), [0.0], Scenes(0.5 * UM, 32))
    with refused("draws are 0|draws"):
        lg.information.reconstruction_trials(
            plain(), [0.0], Scenes(9 * UM), draws=0, rng=np.random.default_rng(0)
        )
    with refused("a scene has shape"):
        lg.information.reconstruction_trials(
            plain(), [0.0], Scenes(9 * UM), draws=[np.ones((3, 3))], rng=np.random.default_rng(0)
        )


@pytest.mark.filterwarnings("default")
def test_full_pixels_are_warned_of():
    with pytest.warns(lg.errors.SamplingWarning, match="the brightest pixel has .* electrons in the mean"):
        reconstruction_error(plain(), [0.0], Scenes(15 * UM, 8), Light(1e7))
