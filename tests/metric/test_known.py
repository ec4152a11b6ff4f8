"""What was known of a camera against what pictures of a board say."""

from dataclasses import replace

import numpy as np
import pytest

from lumigraph import metric
from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.known import disagreement
from metric import scenes

CAMERA, BOARD, NOMINAL = scenes.CAMERA, scenes.BOARD, scenes.NOMINAL
ERRORS = np.array([
    1e-3, 1.1e-3, 2e-6, 0.13, 20.0, 20.0, 1e-3, 1e-3, 0.02, 0.2, 2.0, 1e-3, 1e-3, 1e-3, 1e-3,
])  # fmt: skip
COVARIANCE = np.diag(ERRORS**2)


def told(camera=CAMERA, nominal=NOMINAL, board=BOARD):
    return list(disagreement(camera, COVARIANCE, nominal, board))


def knowing_b(error):
    return replace(NOMINAL, lenslet_distance=CAMERA.lenslet_distance, lenslet_distance_error=error)


def test_without_b_a_note_says_that_nothing_tells_the_spacing() -> None:
    (note,) = told()
    assert note.startswith("nothing that was given shows whether the board's spacing is right")


@pytest.mark.parametrize("off", [1.05, 0.95])
def test_a_b_that_is_as_far_away_as_may_be_is_not_doubted(off) -> None:
    assert not told(replace(CAMERA, lenslet_distance=off * CAMERA.lenslet_distance), knowing_b(0.03))


def test_squares_that_may_be_wider_are_told_with_numbers_and_the_chi_square() -> None:
    """20 % too wide make b a sixth too short: 3.3 of its 5 %."""
    camera = replace(CAMERA, lenslet_distance=CAMERA.lenslet_distance / 1.2)
    spacing, known = told(camera, knowing_b(0.05), replace(BOARD, spacing=12e-3))
    assert "b is 0.35 mm where 0.42 ± 0.021 was known, 3.3 deviations away" in spacing
    assert "imply a spacing of the board of 10 ± 0.99 mm, 12 mm given" in spacing
    total = (
        1 / 9 / 0.05**2 / 4 + np.sum((np.array(CAMERA.axis) - NOMINAL.middle) ** 2) / (0.5e-3 / 5.5e-6) ** 2
    )
    assert total < float(known.split("chi-square ")[1].split()[0]) < total + 1.5
    assert "b is 0.35 mm where 0.42 ± 0.021 was known (3.3 deviations)" in known


def test_squares_that_are_wider_beyond_doubt_are_refused() -> None:
    camera = replace(CAMERA, lenslet_distance=CAMERA.lenslet_distance / 1.2)
    with pytest.raises(
        CalibrationError,
        match=r"8\.\d deviations away: .* spacing of the board of 10 ± 0\.\d+ mm, 12 mm given\. Measure",
    ):
        told(camera, knowing_b(0.02), replace(BOARD, spacing=12e-3))


def test_what_pictures_do_not_tell_is_not_compared() -> None:
    """A focal length 4 of its errors away, of which the pictures take nothing away, can be no news."""
    nominal = replace(knowing_b(0.05), focal_length=CAMERA.focal_length - 4e-3)
    assert not any("f is" in note for note in told(nominal=nominal))
    sure = COVARIANCE.copy()
    sure[0, 0] = 1e-8
    notes = list(disagreement(CAMERA, sure, nominal, BOARD))
    assert any("f is 50 mm where 46 ± 0.92 was known (4.4 deviations)" in note for note in notes)


@pytest.fixture(scope="module")
def seen():
    return scenes.corners(np.random.default_rng(1), frames=4)


def test_a_board_a_fifth_too_wide_makes_b_too_short_and_nothing_else(seen) -> None:
    found = metric.board(seen, replace(BOARD, spacing=12e-3), knowing_b(0.05))
    assert found.camera.lenslet_distance == pytest.approx(CAMERA.lenslet_distance / 1.2, rel=0.01)
    assert found.residual_px == pytest.approx(0.3, rel=0.05)
    assert any(r"imply a spacing of the board of 9.9" in note for note in found.notes)


def test_the_lenslets_pitch_gives_the_exit_pupil_and_with_it_f(seen) -> None:
    ratio = 1 + CAMERA.lenslet_distance / CAMERA.exit_pupil
    found = metric.board(seen, BOARD, replace(NOMINAL, pitch_ratio=ratio, pitch_ratio_error=1e-4))
    off = (found.camera.numbers - CAMERA.numbers)[:4] / found.errors[:4]
    assert (np.abs(off) < 3).all()
    assert found.errors[0] < 0.5e-3  # without: 1 mm, which is the prior's
    assert found.errors[3] < 0.02 * CAMERA.separation / CAMERA.exit_pupil  # without: 10 %


def test_the_ratio_of_pitches_is_that_of_the_lenslets_places() -> None:
    """By two neighbours of an array that does not lean."""
    camera = replace(CAMERA, tilt=(0.0, 0.0))
    _, L, b, part = camera.numbers[:4]
    seen = np.array([[0.0, 0.0], [0.0, 128e-6]])
    place, _ = geometry.lenslets(seen, L, b, L / part, np.zeros(2))
    assert geometry.pitch_ratio(camera.numbers)[0] == pytest.approx(128e-6 / np.ptp(place), rel=1e-12)
