"""Chessboards on pictures, and edges of micro-images."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, spline_filter

from lumigraph.analysis.chart import Chart, find_chart
from lumigraph.analysis.crossings import crossed
from lumigraph.analysis.pupil_edge import pupil_edge
from lumigraph.analysis.saddles import settle
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError, SamplingError


def board(shape, spacing, turn, *, bend=0.0, finer=6):
    """Mean brightness of pixels of a chessboard, bent about the picture's middle as x_d = x (1 + k r²)."""
    y, x = ((np.arange(n * finer) + 0.5) / finer - n / 2 for n in shape)
    y, x = y[:, None], x[None]
    reach = math.hypot(*shape) / 2
    r = np.hypot(y, x) / reach
    ideal = r.copy()
    for _ in range(6):
        ideal = r / (1 + bend * ideal**2)
    scale = np.divide(ideal, r, out=np.ones_like(r), where=r > 0)
    y, x = y * scale, x * scale
    rows = np.floor((math.cos(turn) * y - math.sin(turn) * x) / spacing + 0.5)
    columns = np.floor((math.cos(turn) * x + math.sin(turn) * y) / spacing + 0.5)
    fine = (rows + columns) % 2
    return fine.reshape(shape[0], finer, shape[1], finer).mean((1, 3))


def test_edges_of_a_chart_have_the_pixels_own_mtf():
    found = find_chart(board((150, 190), 26.0, math.radians(7)))
    half = [edge.at(0.5) for _, edge in found.edges()]
    assert len(half) > 40
    assert np.mean(half) == pytest.approx(0.6034 / math.cos(math.radians(7)), rel=0.02)  # of sinc
    assert found.spacing == pytest.approx(26.0, rel=1e-3)


@pytest.mark.parametrize("turn", [0.0, 0.12, 0.7])
def test_corners_are_found_to_a_hundredth_whatever_the_turn(turn):
    picture = gaussian_filter(board((120, 140), 15.0, turn), 1.0)
    found = find_chart(picture)
    middle = (np.array(picture.shape) - 1) / 2
    way = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    units = (found.corners - middle) @ way.T / 15.0 - 0.5
    off = 15.0 * (units - np.rint(units))
    assert len(found) > 40
    assert np.abs(off).max() < 0.05
    assert len(np.unique(found.indices, axis=0)) == len(found)


def test_the_width_of_squares_scatters_as_its_error_says():
    rng, index = np.random.default_rng(4), np.stack(np.mgrid[:6, :7], -1).reshape(-1, 2)
    corners = 10 + index @ np.array([[20.0, 2.5], [-2.5, 20.0]])
    found = [
        Chart(np.zeros((150, 170)), corners + rng.normal(0, 0.1, corners.shape), index) for _ in range(60)
    ]
    assert np.std([one.spacing for one in found]) == pytest.approx(
        np.mean([one.spacing_error for one in found]), rel=0.25
    )
    assert np.mean([one.unevenness for one in found]) == pytest.approx(0.1 * math.sqrt(2) / 20.16, rel=0.1)


def test_corners_near_the_border_can_be_left_out():
    corners = np.array([[2.0, 30.0], [30.0, 30.0], [30.0, 45.5], [49.0, 30.0]])
    inside = Chart(np.zeros((50, 50)), corners, np.eye(4, 2, dtype=int)).within(4.0)
    assert inside.corners.tolist() == [[30.0, 30.0]]


@pytest.mark.parametrize("bend", [-0.03, 0.0, 0.02])
def test_distortion_is_found_within_its_interval(bend):
    rng = np.random.default_rng(3)
    picture = gaussian_filter(board((200, 240), 20.0, 0.12, bend=bend), 1.0)
    value, error = find_chart(picture + 0.01 * rng.standard_normal(picture.shape)).distortion()
    assert abs(value - bend) < 3 * error + 2e-4
    assert error < 2e-3


def test_a_picture_without_a_chart_is_refused():
    with pytest.raises(SamplingError, match="corners of a chessboard were found where 4 are needed"):
        find_chart(np.ones((60, 60)))


def stops(pitch, width, sigma, count=10):
    """A white image of square lenslets whose square stops are blurred, its rows and columns independent."""
    n = round(count * pitch)
    at = (np.arange(n * 5) + 0.5) / 5 - 0.5
    away = np.abs(at % pitch - pitch / 2)
    line = gaussian_filter((away < width / 2).astype(float), sigma * 5, mode="wrap").reshape(n, 5).mean(1)
    lattice = Lattice.square(pitch, origin=(pitch / 2, pitch / 2))
    return np.outer(line, line), Calibration(lattice, (n, n), np.zeros((0, 2), int), np.zeros((0, 2)), 0.0)


@pytest.mark.parametrize(("width", "sigma"), [(12.3, 0.8), (15.5, 1.4), (17.0, 1.0)])
def test_width_and_blur_of_micro_images_are_found(width, sigma):
    found = pupil_edge(*stops(17.37, width, sigma))
    blur = 2.3548 * math.hypot(sigma, 1 / math.sqrt(12))  # a pixel is as wide as its standard deviation says
    assert found.width == pytest.approx(width, rel=0.01)
    assert found.blur == pytest.approx(blur, rel=0.03)
    assert found.directions == pytest.approx(width / blur, rel=0.04)


def test_spill_is_the_light_beyond_the_border():
    found = pupil_edge(*stops(17.37, 16.0, 1.5))
    sigma, t = found.blur / 2.3548, np.linspace(-40, 40, 80001)
    image = gaussian_filter((np.abs(t) < found.width / 2).astype(float), sigma / (t[1] - t[0]))
    assert found.spill == pytest.approx(image[np.abs(t) > 17.37 / 2].sum() / image.sum(), rel=0.01)


def test_micro_images_without_a_border_are_refused():
    white, calibration = stops(17.37, 17.37, 0.5)
    with pytest.raises(CalibrationError, match="Stop the main lens down"):
        pupil_edge(np.ones_like(white), calibration)


@pytest.mark.parametrize(("shrunk", "skew"), [(0.75, 0.0), (0.7, 0.25), (0.6, -0.1)])
def test_a_board_that_leans_is_found_whole(shrunk, skew):
    """Squares of 12 samples are so much narrower, and their sides so far from a right angle."""
    y, x = np.mgrid[:600, :900] / 6 - np.array([50, 75])[:, None, None]
    rows, columns = (np.floor(one / 12 + 0.5) for one in (y - skew * x, x / shrunk))
    inside = (np.abs(rows) <= 2) & (np.abs(columns) <= 3)
    fine = np.where(inside, (rows + columns) % 2, 1.0)
    picture = gaussian_filter(fine, 6).reshape(100, 6, 150, 6).mean((1, 3))
    found = find_chart(picture)
    assert sorted(np.ptp(found.indices, axis=0) + 1) == [4, 6]
    assert len(found) == 24
    assert np.linalg.det(found._squares()[0]) > 0  # it is not mirrored


def saddles(turn, blur, *, finer=40):
    """Of edges that cross at eleven places in a pixel: saddles and crossings less the truth [samples]."""
    rows = []
    for phase in np.linspace(0, 1, 11):
        true = np.array([9.33, 9 + phase])
        y, x = np.mgrid[: 20 * finer, : 20 * finer] / finer + 0.5 / finer - 0.5 - true[:, None, None]
        rows_, columns = math.cos(turn) * y + math.sin(turn) * x, math.cos(turn) * x - math.sin(turn) * y
        fine = gaussian_filter(
            np.sign(np.sin(np.pi * rows_ / 8.3) * np.sin(np.pi * columns / 7)), blur * finer
        )
        picture = fine.reshape(20, finer, 20, finer).mean((1, 3))
        soft = spline_filter(gaussian_filter(picture, 1.0), 3)
        at, kept = settle(soft, true[None] + 0.05, 2, stray=1.5)
        assert kept.all()
        rows.append([at[0] - true, crossed(picture, at, 2)[0] - true])
    return np.moveaxis(np.array(rows), 1, 0)


@pytest.mark.parametrize("turn", [0.03, 0.1, 0.2])
def test_samples_pull_at_saddles_and_not_at_crossings(turn):
    """0.01 of a sample or more, and less than half of it: edges as sharp as pixels."""
    pulled, free = (np.sqrt((one**2).mean()) for one in saddles(turn, 0.0))
    assert pulled > 0.008
    assert free < 0.0055
    assert free < 0.55 * pulled


def test_crossings_of_blurred_edges_are_exact():
    assert np.abs(saddles(0.2, 0.5)[1]).max() < 2e-3


def test_saddles_too_blurred_for_edges_or_at_the_rim_stay():
    flat = np.zeros((9, 9))
    at = np.array([[4.2, 4.1], [0.3, 4.0]])
    np.testing.assert_allclose(crossed(flat, at, 2), at, atol=1e-6)
