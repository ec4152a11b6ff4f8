"""A real plenoptic 1.0 picture of letters: what its refocused pictures must show."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from data_folder import real
from lumigraph.calibration import calibrate, devignette
from lumigraph.rendering import decode, reduce_aperture, refocus_stack


@pytest.fixture(scope="module")
def views():
    from PIL import Image

    white, raw = (
        np.asarray(Image.open(real("letters_plenoptic1", name)))
        for name in ("letters_ULF_M1_white.png", "letters_ULF_M1.png")
    )
    calibration = calibrate(white, pixel_pitch=6.45e-6, separation=0.4, lenslet_distance=18.6e-3)
    return reduce_aperture(decode(devignette(raw, white), calibration), 0.8)


def test_lenslets_stand_as_the_maker_says(views):
    # The maker's pitch is 300 µm and F 400 mm; 48.235 px of 6.45 µm over 1 + 18.6/400 give 297.3 µm.
    np.testing.assert_allclose(views.lenslets.pitch, 297.3e-6, atol=0.2e-6)
    assert views.lenslets.shape == (18, 25)


def test_letters_come_into_focus_one_after_the_other(views):
    alphas = np.linspace(0.94, 1.06, 49)
    stack = refocus_stack(views, alphas, oversample=4)

    def sharpest(columns):
        return alphas[np.argmax(stack[:, :, columns].var((1, 2)))]

    # Interpolation between lenslets blurs every plane but alpha = 1, so sharpness is drawn towards 1: only
    # the order is tested here; the shift between outer views, below, gives the values.
    f, a, b = sharpest(slice(16, 28)), sharpest(slice(28, 40)), sharpest(slice(40, 56))
    assert f == pytest.approx(1, abs=0.01)
    assert a < f - 0.004
    assert b < f - 0.004
    blurred = refocus_stack(views, [0.7, 1.3], oversample=4)
    assert blurred[:, :, 40:56].var((1, 2)).max() < 0.3 * stack[:, :, 40:56].var((1, 2)).max()


@pytest.mark.parametrize(("letter", "alpha"), [("f", 1.002), ("a", 0.985), ("b", 0.976)])
def test_views_from_below_and_above_are_shifted_by_the_letters_alpha(views, letter, alpha):
    columns = {"f": slice(4, 7), "a": slice(7, 10), "b": slice(10, 14)}[letter]
    count, away, few = views.aperture.shape[0], 15, 2
    middle = slice(count // 2 - 8, count // 2 + 9)
    below, above = (
        views.data[k - few : k + few + 1, middle].mean((0, 1)) for k in (count // 2 - away, count // 2 + away)
    )
    t = np.arange(below.shape[0])

    def difference(shift):
        move = CubicSpline(t, below)(t - shift / 2) - CubicSpline(t, above)(t + shift / 2)
        return (move[2:-2, columns] ** 2).sum()

    shifts = np.linspace(-1, 1, 401)
    best = shifts[np.argmin([difference(shift) for shift in shifts])]
    slope = best * views.lenslets.pitch[0] / (2 * away * views.aperture.pitch[0])
    # Measured once with 12, 15 and 18 views either way, which agree to 0.003.
    assert 1 - slope == pytest.approx(alpha, abs=0.006)


def test_pictures_are_upright_and_without_seams(views):
    picture = refocus_stack(views, [0.94, 1.0, 1.06], oversample=1)
    # White paper on the left, the dark background on the right, in every row up to the frame.
    assert (picture[:, :, 0] > 2 * picture[:, :, 20].max()).all() or (picture[:, :, 0] > 200).all()
    assert (picture[:, :, -1] < 0.3 * picture[:, :, 15]).all()
    # The paper is even to 6 % from lenslet to lenslet, the frame included; fixed blocks of 48 px are not.
    paper = picture[1][:, :4]
    assert paper.std() / paper.mean() < 0.06
    # Ascender of the b above its bowl: upright.
    column = picture[1][0:8, 12]
    assert column[:4].mean() < column[-1] * 0.9
