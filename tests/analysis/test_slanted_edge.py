"""The slanted edge against closed forms, and through a simulated camera."""

import math

import numpy as np
import pytest

from lumigraph.analysis import slanted_edge
from lumigraph.errors import SamplingError
from lumigraph.instruments import SingleLensCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.units import mm, nm, um


def lens(frequency, cutoff):
    """MTF of a round, ideal lens in incoherent light: Goodman, equation 6-31."""
    s = np.clip(frequency / cutoff, 0, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s * s))


def drawn(angle, cutoff=1.4, shape=(80, 80)):
    """An edge behind an ideal lens on square pixels, exactly, and the MTF across it.

    The profile is the sine integral of the MTF over f; the pixel, projected onto the normal, is two boxes.
    """
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    distance = (x - shape[1] / 2 + 0.23) * math.cos(angle) - (y - shape[0] / 2 + 0.63) * math.sin(angle)
    nodes, weights = np.polynomial.legendre.leggauss(600)
    f, weights = (nodes + 1) / 2 * cutoff, weights * cutoff / 2

    def truth(frequency):
        pixel = np.sinc(frequency * math.cos(angle)) * np.sinc(frequency * math.sin(angle))
        return lens(frequency, cutoff) * pixel

    waves = np.sin(2 * np.pi * distance.ravel()[:, None] * f)
    return 0.5 + (waves @ (weights * truth(f) / (np.pi * f))).reshape(shape), truth


@pytest.mark.parametrize("degrees", [2, 5, 8, 15, 20])
def test_an_ideal_lens_on_square_pixels_has_its_closed_form(degrees):
    """To 0.008 up to the pixels' limit; without the bins' correction it is .017, in plain columns .09."""
    image, truth = drawn(math.radians(degrees))
    edge = slanted_edge(image)
    held = edge.frequencies <= 0.5
    np.testing.assert_allclose(edge.mtf[held], truth(edge.frequencies[held]), atol=0.008)
    assert math.degrees(edge.angle) == pytest.approx(degrees, abs=0.01)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_edges_of_every_side_give_one_mtf(turn):
    image, _ = drawn(math.radians(6), shape=(70, 90))
    straight, turned = slanted_edge(image), slanted_edge(np.rot90(image, turn))
    assert turned.at(0.5) == pytest.approx(straight.at(0.5), rel=0.01)
    mirrored = slanted_edge(1 - image[:, ::-1])
    assert mirrored.at(0.5) == pytest.approx(straight.at(0.5), rel=0.01)


def test_the_pitch_turns_cycles_per_pixel_into_metres(xp):
    image, _ = drawn(math.radians(5))
    edge, pixels = slanted_edge(xp.asarray(image), 4e-6), slanted_edge(image)
    assert edge.at(0.5) == pytest.approx(pixels.at(0.5) / 4e-6, rel=1e-5)
    assert edge.position[-1] == pytest.approx(pixels.position[-1] * 4e-6)
    assert edge.levels == pytest.approx((0.0, 1.0), abs=0.03)


def test_noise_of_a_hundredth_leaves_the_frequency_of_half_contrast(rng):
    image, truth = drawn(math.radians(5))
    found = slanted_edge(image + rng.normal(0, 0.01, image.shape)).at(0.5)
    assert truth(found) == pytest.approx(0.5, abs=0.04)


def test_a_bent_edge_needs_a_higher_degree():
    y, x = np.mgrid[:100, :80] - 40.0
    image = np.clip(x - 0.1 * y - 4e-3 * (y - 10) ** 2 + 5.5, 0, 1)
    sharp = slanted_edge(np.clip(x - 0.1 * y, 0, 1)).at(0.5)
    assert slanted_edge(image, degree=2).at(0.5) == pytest.approx(sharp, rel=0.03)
    assert slanted_edge(image).at(0.5) < 0.6 * sharp


def test_pictures_without_one_slanted_edge_are_refused():
    y, x = np.mgrid[:60, :60] - 29.5
    for image, message in [
        (np.ones((8, 60)), r"shape \(8, 60\) but needs \(y, x\) from 16 x 16"),
        (np.random.default_rng(0).random((60, 60)), "there is no edge"),
        (np.clip(x, 0, 1), "the edge moves by .* pixels over 60 rows"),
        (np.clip(x - 26 - 0.1 * y, 0, 1), "too close to the sides|there is no edge"),
    ]:
        with pytest.raises(SamplingError, match=message):
            slanted_edge(image)


def test_a_simulated_camera_has_the_mtf_of_its_lens_and_pixels():
    """Wave optics from the object to the pixels, against 2/π (acos s - s √(1 - s²)) and the pixel's sincs."""
    camera = SingleLensCamera(
        wavelength=550 * nm,
        object_distance=100 * mm,
        main_lens={"focal_length": 50 * mm, "diameter": 10 * mm},
        sensor={"pixel_pitch": 3 * um, "shape": (200, 200)},
    )
    raw = simulate(camera, targets.slanted_edge(camera.object_grid))
    edge = slanted_edge(raw.data[20:-20, 20:-20], camera.sensor.pixel_pitch)
    held = edge.frequencies < 0.5 / (3 * um)
    f = edge.frequencies[held]
    areas = (
        3 * um,
        camera.object_grid.pitch[1] * camera.magnification,
    )  # pixels, and the target's grey samples
    squares = [np.sinc(f * w * math.cos(edge.angle)) * np.sinc(f * w * math.sin(edge.angle)) for w in areas]
    expected = lens(f, 1 / (550 * nm * camera.f_number)) * squares[0] * squares[1]
    np.testing.assert_allclose(edge.mtf[held], expected, atol=0.01)
