"""Cameras measured by boards: drawn ones, whose truth is known, and COMPOTE's real corners."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lumigraph as lg
from data_folder import DATA
from lumigraph.metrology import Board, Corners, MetricCamera, Nominal, board, triangulate
from lumigraph.metrology.boards import calibration, geometry
from lumigraph.metrology.boards.noise import Noise

from .scenes import BOARD, CAMERA, NOMINAL, VIEWS_CAMERA, corners, corners_in_views


@pytest.fixture(scope="module")
def seen() -> Corners:
    return corners(np.random.default_rng(1))


@pytest.fixture(scope="module")
def measured(seen: Corners) -> lg.metrology.Measured:
    return board(seen, BOARD, NOMINAL)


def test_a_point_shows_where_the_lens_equations_say() -> None:
    f, L, b, pitch = 60e-3, 130e-3, 5e-3, 5e-6
    camera = MetricCamera(f, L, b, L, pitch, (0.0, 0.0))
    z = 0.12
    image = 1 / (1 / f - 1 / z)  # 0.12 m behind the lens, 10 mm before the lenslets: m = 1/2
    lenslet = np.array([1.5e-3, -0.3e-3])
    center = lenslet * (1 + b / L)  # chief rays through the pupil
    shown = lenslet * (1 + 0.5) - 0.5 * np.array([1e-3, 2e-3]) * image / z  # PHYSICS: s = c (1 + m) - m X
    np.testing.assert_allclose(camera.project(np.array([z, 1e-3, 2e-3]), center / pitch), shown[None] / pitch)
    assert camera.magnification(z) == pytest.approx(0.5)


def test_boards_turn_as_right_handed_frames_do() -> None:
    pose = np.array([0.3, -0.2, 0.5, 0.1, 0.2, 0.3])
    points = np.random.default_rng(0).normal(size=(5, 3))
    turned = Rotation.from_rotvec(pose[2::-1]).apply(points[:, ::-1])[:, ::-1] + pose[3:]
    np.testing.assert_allclose(geometry.moved(points, pose), turned)


def test_derivatives_by_complex_steps_are_those_of_differences(seen: Corners) -> None:
    numbers, pitch = CAMERA.numbers, CAMERA.pixel_pitch
    points = np.array([[0.3, 0.01, -0.02]])
    center, kind = np.array([[1000.0, 2500.0]]), np.array([1])
    for k in range(len(numbers)):
        size = 1e-5 * (abs(numbers[k]) if k < 6 else 0.1)
        step, turn = numbers.astype(complex), np.zeros(len(numbers))
        step[k] += 1e-20j
        turn[k] = size
        exact = geometry.project(step, points, center, kind, pitch).imag / 1e-20
        ends = [geometry.project(numbers + s * turn, points, center, kind, pitch) for s in (1, -1)]
        np.testing.assert_allclose(exact, (ends[0] - ends[1]) / (2 * size), rtol=1e-5, atol=1e-6)


def test_white_noise_comes_out_of_noise_that_corners_share() -> None:
    rng = np.random.default_rng(3)
    sight = np.repeat(np.arange(400), rng.integers(2, 30, 400))
    kind = rng.integers(0, 2, len(sight))
    noise = Noise(np.array([0.3, 0.9]), 0.5)
    values = rng.normal(size=(len(sight), 2)) * noise.own[kind][:, None] + rng.normal(0, 0.5, (400, 2))[sight]
    white = noise.whitened(values, sight, noise.each(kind))
    means = np.stack([np.bincount(sight, w) for w in white.T], 1) / np.sqrt(np.bincount(sight))[:, None]
    assert white.std() == pytest.approx(1, abs=0.02)
    assert means.std() == pytest.approx(1, abs=0.1)  # shared noise alone would make it above 2
    found = Noise.of(values, sight, kind)
    np.testing.assert_allclose(found.own, noise.own, rtol=0.05)
    assert found.shared == pytest.approx(0.5, rel=0.1)


def test_a_drawn_camera_comes_back_within_its_intervals(measured: lg.metrology.Measured) -> None:
    off = (measured.camera.numbers - CAMERA.numbers) / measured.errors
    assert np.abs(off[:8]).max() < 4
    assert measured.residual_px == pytest.approx(0.3, rel=0.05)
    assert measured.camera.lenslet_distance == pytest.approx(CAMERA.lenslet_distance, rel=0.01)
    assert not any("not flat" in note for note in measured.notes)
    names = {(one, other) for one, other, _ in measured.tied()}
    assert ("f", "L") in names
    assert any("f and L change the pictures alike" in note for note in measured.notes)


def test_lengths_that_are_not_known_to_one_per_cent_are_named(measured: lg.metrology.Measured) -> None:
    """f, and L and distances with it, rest on the 2 % of a data sheet."""
    note = next(one for one in measured.notes if one.startswith("not known to 1%"))
    half = 196 * measured.errors[0] / measured.camera.focal_length
    assert f"f ± {half:.2g} %, L ± " in note
    assert "the board's distance ± " in note
    sure = dataclasses.replace(measured, covariance=1e-6 * measured.covariance, poses=())
    assert not list(calibration._unsure(sure))


def test_noise_that_lenslets_share_widens_the_intervals(measured: lg.metrology.Measured) -> None:
    shared = board(corners(np.random.default_rng(1), shared=0.3), BOARD, NOMINAL)
    assert shared.noise.shared == pytest.approx(0.3, rel=0.2)
    assert shared.errors[2] > 1.5 * measured.errors[2]  # the distance b, which only the pictures tell


def test_a_board_that_took_no_part_is_found_as_well_as_predicted(measured: lg.metrology.Measured) -> None:
    other = corners(np.random.default_rng(7), frames=3)
    for pose in measured.locate(other):
        chance = 3 / np.sqrt(4 * np.sum(other.frame == pose.frame))
        assert pose.residual_px == pytest.approx(pose.expected_px, rel=chance)
        assert 0.15 < pose.shift[0] < 0.4


def test_a_point_is_triangulated_within_its_error(measured: lg.metrology.Measured) -> None:
    point = np.array([0.28, 0.012, -0.02])
    y, x = np.mgrid[-3:4, -3:4].reshape(2, -1) * 23.3
    middle = CAMERA.project(point, np.array([1540.0, 2060.0]))[0]
    center = middle + np.stack([y, x], 1)
    rng = np.random.default_rng(5)
    place = CAMERA.project(point, center) + rng.normal(0, 0.3, (49, 2))
    found = triangulate(measured, place, center)
    assert np.all(np.abs(found.position - point) < 4 * found.errors)
    assert abs(found.position[0] / point[0] - 1) < 0.02
    alone = triangulate(dataclasses.replace(measured, covariance=0 * measured.covariance), place, center)
    assert np.all(alone.errors < found.errors)


def test_places_that_share_an_error_leave_a_point_less_sure(measured: lg.metrology.Measured) -> None:
    point, center = np.array([0.28, 0.012, -0.02]), np.array([1540.0, 2060.0]) + 23.3 * np.mgrid[
        -3:4, -3:4
    ].reshape(2, -1).T  # fmt: skip
    place = CAMERA.project(point, center)
    known = dataclasses.replace(measured, covariance=0 * measured.covariance)
    shared = dataclasses.replace(known, noise=Noise(measured.noise.own, 0.5))
    found = [triangulate(one, place, center) for one in (known, shared)]
    # A shift of all places by 0.5 px moves the point sideways by that over what a metre moves them.
    metre = np.diff(CAMERA.project(point + np.outer([0, 1e-4], [0, 1, 0]), center[:1].repeat(2, 0)), axis=0)
    extra = np.sqrt(found[1].covariance[1, 1] - found[0].covariance[1, 1])
    assert extra == pytest.approx(0.5 / abs(metre[0, 0] / 1e-4), rel=0.02)


def test_a_board_that_is_not_flat_is_measured_with_its_heights() -> None:
    y, x = np.mgrid[:5, :7].reshape(2, -1)
    true = 0.2e-3 * np.sin(1.5 * x) * (1 + 0.2 * y)
    bent = dataclasses.replace(BOARD, heights=tuple(true.tolist()))
    seen = corners(np.random.default_rng(4), noise=0.2, board=bent)
    found = board(seen, BOARD, NOMINAL)
    flat = np.column_stack([np.ones(35), y, x])
    off = np.array(found.board.heights) - true
    off -= flat @ np.linalg.lstsq(flat, off, rcond=None)[0]  # a plane is the pose's
    assert off.std() < 0.15 * true.std()
    assert found.residual_px == pytest.approx(0.2, rel=0.05)
    assert found.noise.shared < 0.1  # 0.4 px if the board is taken to be flat
    assert any("the board is not flat: its corners stand" in note for note in found.notes)


def test_noise_that_grows_with_blur_is_predicted_for_boards_elsewhere() -> None:
    found = board(corners(np.random.default_rng(2), trend=-1.5), BOARD, NOMINAL)
    assert found.noise.trend == pytest.approx([-1.5, -1.5], abs=0.2)
    other, far = corners(np.random.default_rng(8), frames=4, trend=-1.5), []
    for pose in found.locate(other):
        chance = 3 / np.sqrt(4 * np.sum(other.frame == pose.frame))
        assert pose.residual_px == pytest.approx(pose.expected_px, rel=chance)
        far.append(pose.expected_px)
    assert max(far) > 1.15 * min(far)  # so that one noise for all would not pass


def test_a_wild_corner_is_left_out_and_counted(seen: Corners, measured: lg.metrology.Measured) -> None:
    place = seen.place.copy()
    place[::200] += 8
    wild = board(dataclasses.replace(seen, place=place), BOARD, NOMINAL)
    assert wild.left_out == len(place[::200])
    assert wild.camera.focal_length == pytest.approx(measured.camera.focal_length, rel=5e-3)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"frame": np.zeros(3, int)}, "columns have|place has shape"),
        ({"corner": np.array([0.5])}, "must be \\(n,\\), integers"),
        ({"place": np.array([[np.nan, 0.0]])}, "place has 1 NaN"),
        ({"kind": np.array([3])}, "kinds 0 to 2"),
        ({"center": np.array([[0.0, -1e150]])}, r"center reaches to 1e\+150 px but at most 1e\+06 px"),
    ],
)
def test_corners_that_cannot_be_are_refused(change: dict, match: str) -> None:
    one = np.zeros(1, int)
    good = {"frame": one, "corner": one, "place": np.zeros((1, 2)), "center": np.zeros((1, 2)), "kind": one}
    with pytest.raises(lg.CalibrationError, match=match):
        Corners(**{**good, **change})


def test_boards_that_tell_nothing_are_refused(seen: Corners) -> None:
    with pytest.raises(lg.CalibrationError, match="on 2 pictures but must be on 3"):
        board(seen[seen.frame < 2], BOARD, NOMINAL)
    with pytest.raises(lg.CalibrationError, match="corner 34 is not one of the board's, 0 to 8"):
        board(seen, Board((3, 3), 0.01), NOMINAL)
    first = np.unique(seen.sights(), return_index=True)[1]
    with pytest.raises(lg.CalibrationError, match="no picture has 6 corners that 3 lenslets show"):
        board(seen[first], BOARD, NOMINAL)
    with pytest.raises(lg.FormatError, match="must be written as '9 x 5 corners, 10 mm'"):
        Board.from_text("9 by 5")
    with pytest.raises(lg.GeometryError, match="focal_length is 0 but must be above 0"):
        Nominal(0.0, 5e-6, (10, 10))


def test_six_corners_are_enough_for_a_picture_and_five_are_not(
    seen: Corners, measured: lg.metrology.Measured
) -> None:
    """The least that a pose is found by, of a picture by itself and of one among others."""
    first = seen[seen.frame == 0]
    six, five = (first[np.isin(first.corner, [0, 3, 6, 14, 28, 34][:n])] for n in (6, 5))
    (pose,) = measured.locate(six)
    assert pose.shift == pytest.approx(measured.locate(first)[0].shift, abs=2e-3)
    with pytest.raises(lg.CalibrationError, match=r"no picture has 6 corners .* the best has 5"):
        measured.locate(five)
    for few, poses in ((six, [0, 1, 3, 4]), (five, [1, 3, 4])):
        kept = np.isin(seen.frame, [1, 3, 4]) | (seen.frame == 0) & np.isin(seen.corner, few.corner)
        assert [one.frame for one in board(seen[kept], BOARD, NOMINAL).poses] == poses


def test_one_picture_given_three_times_is_no_camera(seen: Corners) -> None:
    """b came out as 0, f to 12 µm, without a word."""
    one = seen[seen.frame == 0]
    same = Corners(
        np.repeat([0, 1, 2], len(one)), np.tile(one.corner, 3),
        np.tile(one.place, (3, 1)), np.tile(one.center, (3, 1)), np.tile(one.kind, 3),
    )  # fmt: skip
    with pytest.raises(lg.CalibrationError, match="stands the same on all 3 pictures"):
        board(same, BOARD, NOMINAL)


def test_a_measured_camera_survives_its_file(measured: lg.metrology.Measured, tmp_path) -> None:
    lg.metrology.save(measured, tmp_path / "camera.json")
    again = lg.metrology.load(tmp_path / "camera.json")
    assert again.camera == measured.camera
    assert again.board == measured.board
    assert again.noise.seen == measured.noise.seen
    np.testing.assert_array_equal(again.noise.trend, measured.noise.trend)
    np.testing.assert_array_equal(again.covariance, measured.covariance)
    np.testing.assert_array_equal(again.poses[1].shift, measured.poses[1].shift)
    (tmp_path / "camera.json").write_text('{"kind": "lumigraph metric camera", "camera": {}}')
    with pytest.raises(lg.FormatError, match=r"camera\.json"):
        lg.metrology.load(tmp_path / "camera.json")


def test_corners_survive_their_table(seen: Corners, tmp_path) -> None:
    lg.metrology.save_corners(seen, tmp_path / "corners.csv")
    again = lg.metrology.load_corners(tmp_path / "corners.csv")
    np.testing.assert_array_equal(again.place, seen.place)
    np.testing.assert_array_equal(again.kind, seen.kind)
    (tmp_path / "corners.csv").write_text("frame,corner,y\n1,2,3\n")
    with pytest.raises(lg.FormatError, match="must have frame, corner, y, x, center_y, center_x"):
        lg.metrology.load_corners(tmp_path / "corners.csv")


@pytest.mark.long  # 20 adjustments
def test_the_truth_lies_in_nine_of_ten_intervals() -> None:
    inside = []
    for seed in range(20):
        found = board(corners(np.random.default_rng(100 + seed), frames=5, shared=0.15), BOARD, NOMINAL)
        off = np.abs(found.camera.numbers - CAMERA.numbers) / found.errors
        inside.append(off[[0, 1, 2]] < 1.96)
    assert np.mean(inside) > 0.88


@pytest.mark.skipif(not (DATA / "compote_r12a").is_dir(), reason="the real corners are not here")
@pytest.mark.long  # 20 s
def test_a_raytrix_r12_is_measured_as_its_makers_lens_says() -> None:
    seen, target, nominal = lg.metrology.load_compote(DATA / "compote_r12a")
    found = board(seen, target, nominal)
    assert found.residual_px < 0.72
    assert found.camera.focal_length == pytest.approx(49.89e-3, rel=0.01)
    assert found.errors[0] > 0.5e-3  # the corners alone do not tell it


def test_corners_without_noise_lose_no_place() -> None:
    """What is left over is rounding, which has no wild ones."""
    seen = corners_in_views(np.random.default_rng(0), frames=4, views=3, noise=0.0, shared=0.0)
    found = board(seen, BOARD, NOMINAL)
    assert found.left_out == 0
    assert found.camera.numbers[:3] == pytest.approx(VIEWS_CAMERA.numbers[:3], rel=1e-5)
