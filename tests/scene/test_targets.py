import math
import sys

import numpy as np
import pytest
from scipy import ndimage

from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError, SamplingWarning
from lumigraph.scene import Diffuser, Points, targets

UM = 1e-6


def drawn(scene):
    (part,) = scene.parts
    return part.intensity


@pytest.mark.parametrize("diameter", [1.3 * UM, 10 * UM, 33 * UM])
def test_a_pinhole_has_its_exact_area_and_place(diameter):
    grid = Grid((60, 71), (1 * UM, 0.9 * UM))
    picture = drawn(targets.pinhole(grid, diameter, (3.3 * UM, -7.1 * UM)))
    assert picture.sum() * 0.9 * UM**2 == pytest.approx(math.pi * diameter**2 / 4, rel=1e-9)
    # The centroid of area fractions is right to a small part of a sample.
    assert np.average(grid.y, weights=picture.sum(1)) == pytest.approx(3.3 * UM, abs=0.1 * UM)
    assert np.average(grid.x, weights=picture.sum(0)) == pytest.approx(-7.1 * UM, abs=0.1 * UM)


def test_an_edge_is_bright_on_the_right_and_its_slope_is_its_angle():
    grid = Grid.square(100, 1 * UM)
    picture = drawn(targets.slanted_edge(grid))
    # Bright width of each row, so the edge's column: x = -y tan(angle).
    columns = grid.size[1] / 2 - picture.sum(1) * UM
    slope = np.polyfit(grid.y, columns, 1)[0]
    assert slope == pytest.approx(-math.tan(math.radians(5)), rel=1e-9)
    np.testing.assert_allclose(picture[:, [0, -1]], [[0, 1]] * 100, atol=1e-12)


def test_an_edge_passes_through_its_position_and_turns_to_bright_below():
    grid = Grid.square(40, 1 * UM)
    picture = drawn(targets.edge(grid, math.pi / 2, (3 * UM, 0.0)))
    assert np.flatnonzero(picture[:, 0] > 0.25)[0] == 23
    assert picture[23, 0] == pytest.approx(0.5)


@pytest.mark.parametrize("dark", [False, True])
def test_usaf_bars_have_the_standards_widths_gaps_and_lengths(dark):
    grid = Grid((1100, 800), 4 * UM)
    picture = drawn(targets.usaf1951(grid, groups=(2, 3), dark_bars=dark))
    picture = 1 - picture if dark else picture
    labels, count = ndimage.label(picture > 0)
    assert count == 2 * 6 * 6
    index = np.arange(1, count + 1)
    areas = ndimage.sum_labels(picture, labels, index) * (4 * UM) ** 2
    middles = np.array(ndimage.center_of_mass(picture, labels, index)) * 4 * UM
    boxes = ndimage.find_objects(labels)
    upright = np.array([b[0].stop - b[0].start > b[1].stop - b[1].start for b in boxes])
    for group in (2, 3):
        for element in range(1, 7):
            width = 0.5e-3 / 2 ** (group + (element - 1) / 6)
            # Neighbouring elements differ by 26 % in area; coverage is exact.
            places = []
            for kind, axis in ((upright, 1), (~upright, 0)):
                mine = kind & (abs(areas / (5 * width**2) - 1) < 1e-6)
                assert mine.sum() == 3
                places.append(middles[mine].mean(axis=0))
                steps = np.diff(np.sort(middles[mine, axis]))
                # Centroids of grey samples are right to hundredths of a sample; elements differ by 12 %.
                np.testing.assert_allclose(steps, 2 * width, atol=0.15 * UM)
                np.testing.assert_allclose(middles[mine, 1 - axis], middles[mine, 1 - axis].mean(), atol=1e-9)
            # Lying bars stand beside the upright ones, two widths apart.
            np.testing.assert_allclose(places[1] - places[0], [0, 7 * width], atol=0.15 * UM)


def test_usaf_line_pairs_measured_by_run_lengths():
    # Group 4, element 1: 16 line pairs per mm, 31.25 um bars on samples of 31.25/8 um.
    grid = Grid.square(400, 31.25 * UM / 8)
    picture = drawn(targets.usaf1951(grid, groups=4))
    row = picture[np.flatnonzero(picture.any(axis=1))[0] + 20]
    edges = np.flatnonzero(np.diff((row > 0.5).astype(int)))
    assert np.abs(np.diff(edges[:6]) - 8).max() <= 1
    assert (edges[4] - edges[0]) / 2 == pytest.approx(16, abs=0.5)


def test_usaf_charts_that_do_not_fit_say_the_size_needed():
    with pytest.raises(
        GeometryError, match=r"USAF groups 2 to 4 take 3\.8\d* x 2\.75 mm but the grid has 1 x 1 mm"
    ):
        targets.usaf1951(Grid.square(200, 5 * UM))
    with pytest.raises(GeometryError, match="groups are 4 to 2: give the coarser"):
        targets.usaf1951(Grid.square(200, 5 * UM), groups=(4, 2))


def test_usaf_bars_narrower_than_samples_warn():
    with pytest.warns(SamplingWarning, match=r"the finest bars are 17\.54 µm wide, samples 20 µm apart"):
        targets.usaf1951(Grid.square(300, 20 * UM), groups=(2, 4))


def test_gratings_hold_the_five_frequencies_of_the_thesis():
    grid = Grid((50, 2000), 5 * UM)  # 10 mm: 100 /m per bin of the transform
    picture = drawn(targets.gratings(grid))
    for band, frequency in enumerate((0.10e4, 0.80e4, 1.52e4, 2.22e4, 2.94e4)):
        rows = picture[10 * band : 10 * band + 10]
        np.testing.assert_allclose(rows, rows[:1].repeat(10, 0))
        spectrum = np.abs(np.fft.rfft(rows[0] - 0.5))
        assert np.argmax(spectrum) * 100 == pytest.approx(frequency)
        # All of a wave that fits the window lies in one bin: amplitude 0.5.
        assert spectrum.max() == pytest.approx(0.25 * 2000, rel=1e-9)


def test_gratings_side_by_side_are_the_same_waves():
    grid = Grid((4, 100), 5 * UM)
    apart, above = (drawn(targets.gratings(grid, (1e3, 2e4), stacked=s)) for s in (False, True))
    np.testing.assert_allclose(apart[0, :50], above[0, :50])
    np.testing.assert_allclose(apart[0, 50:], above[2, 50:])


def test_gratings_warn_beyond_the_grids_frequencies_and_refuse_none():
    with pytest.warns(
        SamplingWarning, match=r"2\.94e\+04 /m is drawn on samples 20 µm apart, which hold less than"
    ):
        targets.gratings(Grid.square(100, 20 * UM), (2.94e4,))
    with pytest.raises(GeometryError, match="no frequencies were given"):
        targets.gratings(Grid.square(100, 20 * UM), ())
    with pytest.raises(GeometryError, match="frequency is 0 1/m but must be above"):
        targets.gratings(Grid.square(100, 20 * UM), (0.0,))


def test_a_siemens_star_has_its_spokes_and_half_its_disc():
    grid = Grid.square(301, 1 * UM)
    picture = drawn(targets.siemens_star(grid, spokes=24, diameter=280 * UM))
    # Eight by eight points a sample: edges to 1/32 of a sample on a rim of 24 spokes.
    assert picture.sum() == pytest.approx(math.pi * 140**2 / 2, rel=2e-3)
    theta = np.arange(0, 2 * math.pi, 1e-3)
    ring = ndimage.map_coordinates(picture, [150 + 100 * np.sin(theta), 150 + 100 * np.cos(theta)], order=1)
    assert np.argmax(np.abs(np.fft.rfft(ring - ring.mean()))) == 24
    assert picture[150, 250] == 1.0
    with pytest.raises(GeometryError, match=r"spokes is 0 but must be a whole number"):
        targets.siemens_star(grid, 0)


def test_a_photo_fills_the_grid_upright_without_distortion():
    image = np.zeros((30, 20), np.uint8)
    image[:10] = 255
    (part,) = targets.photo(Grid((60, 80), 1 * UM), image).parts
    assert part.intensity.shape == (60, 40)
    assert part.grid.center == (0.0, 0.0)
    np.testing.assert_allclose(part.intensity[2:15], 1.0, atol=1e-6)
    np.testing.assert_allclose(part.intensity[25:], 0.0, atol=1e-6)


def test_the_photographer_comes_with_scikit_image():
    picture = drawn(targets.photo(Grid.square(64, 1 * UM)))
    assert picture.shape == (64, 64)
    assert 0.3 < picture.mean() < 0.7


def test_photos_of_other_shapes_or_with_nan_are_refused():
    with pytest.raises(GeometryError, match=r"a photo has shape \(y, x\) or \(y, x, c\), not \(4,\)"):
        targets.photo(Grid.square(8, 1.0), np.zeros(4))
    with pytest.raises(LumigraphError, match="the photo has 16 NaN"):
        targets.photo(Grid.square(8, 1.0), np.full((4, 4), np.nan))


def test_points_take_two_or_three_coordinates_and_weights():
    (part,) = targets.points([(1e-3, -2e-3), (0, 0, 5e-3)], [1, 2]).parts
    assert isinstance(part, Points)
    np.testing.assert_allclose(part.positions, [[1e-3, -2e-3, 0], [0, 0, 5e-3]])
    assert part.intensities.tolist() == [1, 2]
    with pytest.raises(GeometryError, match=r"point 1 has 1 numbers but needs \(y, x\) or \(y, x, dz\)"):
        targets.points([(0, 0), (0,)])


def test_white_is_a_diffuser():
    assert targets.white(0.5).parts == (Diffuser(0.5),)


def test_a_pinhole_outside_the_grid_is_refused():
    with pytest.raises(GeometryError, match=r"the pinhole at \(0\.001, 0\) m lies outside the grid"):
        targets.pinhole(Grid.square(10, 1 * UM), position=(1e-3, 0))


def test_a_chessboard_has_its_corners_where_they_are_told():
    grid, angle = Grid.square(400, 1e-4), 0.3
    board = targets.chessboard(grid, (3, 4), 5e-3, angle=angle, position=(1e-3, -2e-3)).parts[0].intensity
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for row in range(3):
        for column in range(4):
            y, x = turned @ (np.array([row - 1, column - 1.5]) * 5e-3) + (1e-3, -2e-3)
            corner = np.array([y, x]) / 1e-4 + 200
            steps = turned @ np.array([[1, 1, -1, -1], [1, -1, 1, -1]]) * 12
            around = [board[tuple(np.rint(corner + step).astype(int))] for step in steps.T]
            light = float((row + column) % 2 == 1)
            assert around == [light, 1 - light, 1 - light, light]
    assert board[0].min() == 1.0


def test_a_chessboard_fills_its_grid_but_for_a_margin():
    board = targets.chessboard(Grid.square(440, 1e-4)).parts[0].intensity
    dark = np.flatnonzero((board < 0.6).any(0))
    assert (dark[0], dark[-1]) == (40, 400)


def test_without_scikit_image_one_line_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "skimage.data", None)
    with pytest.raises(LumigraphError, match=r"pip install 'lumigraph\[photo\]'"):
        targets.photo(Grid((8, 8), 1e-6))
