"""Boards of dots, and with markers."""

import json
from dataclasses import replace

import numpy as np
import pytest

from lumigraph import metrology
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError, FormatError, LumigraphError
from lumigraph.metrology import Board, Corners, MetricCamera
from lumigraph.metrology.boards import chessboard, finding, geometry, windows
from lumigraph.metrology.boards.adjustment import AdjustmentProblem
from lumigraph.metrology.boards.noise import Noise
from lumigraph.preparation import prepare
from metrology import drawn, drawn_views, scenes

DOTS = Board((7, 8), 1.6e-3, "dots", 0.7e-3)
ASYMMETRIC = Board((9, 4), 1.2e-3, "asymmetric dots", 0.9e-3)
CHARUCO = Board((4, 5), 3.6e-3, "charuco", 2.7e-3, "DICT_4X4_50")


@pytest.mark.parametrize(
    ("text", "board"),
    [
        ("9 x 5 corners, 10 mm", Board((5, 9), 0.01)),
        ("9×5, 10 mm", Board((5, 9), 0.01)),
        ("11 x 4 dots, 10 mm", Board((4, 11), 0.01, "dots")),
        ("11 x 4 dots, 10 mm, dots 4 mm", Board((4, 11), 0.01, "dots", 4e-3)),
        ("4 x 11 asymmetric dots, 10 mm", Board((11, 4), 0.01, "asymmetric dots")),
        (
            "9 x 6 charuco, 10 mm, markers 7 mm, DICT_4X4_50",
            Board((6, 9), 0.01, "charuco", 7e-3, "DICT_4X4_50"),
        ),
    ],
)
def test_boards_are_written_as_text(text, board):
    assert Board.from_text(text) == board


@pytest.mark.parametrize(
    "text",
    [
        "9 x 5",
        "9 x 5 crosses, 1 mm",
        "9 x 5, 1 mm, dots 1 mm, markers 1 mm",
        "9 x 5 dots, 1 mm, markers 1 mm",
    ],
)
def test_other_text_is_refused_with_all_that_is_possible(text):
    with pytest.raises(FormatError, match=r"must be written as '9 x 5 corners, 10 mm', .* or '9 x 6 charuco"):
        Board.from_text(text)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("9 x 6 charuco, 10 mm", "give both the width of its markers and the dictionary"),
        ("9 x 6 charuco, 10 mm, DICT_4X4_50", "give both the width of its markers and the dictionary"),
        ("9 x 6 dots, 10 mm, DICT_4X4_50", "a ChArUco board, and no other, has markers"),
        ("9 x 6 corners, 10 mm, dots 4 mm", "a chessboard has neither dots nor markers"),
        ("9 x 6 dots, 10 mm, dots 12 mm", "12 mm wide do not fit side by side, 10 mm apart"),
        ("9 x 2 dots, 10 mm", "2 x 9 corners but needs 3"),
    ],
)
def test_boards_that_cannot_be_are_refused(text, match):
    with pytest.raises(CalibrationError, match=match):
        Board.from_text(text)


def middle_of_ellipse(places):
    """Of the conic through places (n, 2), by its five numbers."""
    origin = places.mean(0)
    y, x = (places - origin).T / np.ptp(places)
    a, b, c, d, e = np.linalg.lstsq(np.stack([y * y, y * x, x * x, y, x], 1), np.ones(len(y)), rcond=None)[0]
    return origin + np.linalg.solve([[2 * a, b], [b, 2 * c]], [-d, -e]) * np.ptp(places)


@pytest.mark.parametrize("in_views", [False, True])
def test_outlines_of_leaning_dots_are_ellipses_about_what_the_adjustment_expects(in_views):
    """Circles through the camera's rays, and conics through them; taken as the dots' own, 0.3 px off."""
    camera = MetricCamera(50e-3, 57e-3, 1.2e-3, 50e-3, 5.5e-6, (1540.0, 2060.0))
    board, pose = Board((4, 5), 10e-3, "dots", 8e-3), drawn.pose((0.1, 0.5, -0.4), 0.3, Board((4, 5), 10e-3))
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rim = board.radius * np.stack([0 * turn, np.sin(turn), np.cos(turn)], 1)
    center, way, kind = np.array([[1500.0, 2100.0]]), np.array([[4.0, -5.0]]), np.zeros(24, int)
    places, centers = np.zeros((20, 2)), np.zeros((20, 2))
    for k, point in enumerate(board.points()):
        outline = geometry.moved(point + rim, pose)
        if in_views:
            seen_at = np.broadcast_to(way, (24, 2)), np.zeros((24, 2))
            seen = geometry.centers(camera.numbers, outline, seen_at, kind, camera.pixel_pitch)
            centers[k] = middle_of_ellipse(seen)
            places[k] = centers[k] + way[0]
        else:
            centers[k], places[k] = center[0], middle_of_ellipse(camera.project(outline, center))
    corners = Corners(np.zeros(20, int), np.arange(20), places, centers, np.zeros(20, int), in_views=in_views)

    def misfit(board):
        problem = AdjustmentProblem(
            corners, board, corners.frame, camera, [], Noise(np.ones(1), 0.0), corners.sights(), np.ones(20)
        )
        return np.abs(problem.misfit(np.concatenate([np.zeros(problem.free.shape[1]), pose]))).max()

    assert misfit(board) < 1e-5
    assert misfit(Board((4, 5), 10e-3)) > 0.3


def found_in(board, where, side=1.0, kinds=1):
    pytest.importorskip("cv2", reason="OpenCV finds the board")
    camera = drawn.camera(side, kinds)
    raw = drawn.raw(camera, where, kinds, board=board)
    ready = prepare(raw, drawn.calibration(kinds), white=drawn.white(kinds))
    return camera, metrology.find_corners([ready], board)


def off(found, camera, points):
    """From the truth (n, 2) [px], with the board counted from either end."""
    ways = [
        found.place - camera.project(each[found.corner], found.center, found.kind)
        for each in (points, points[::-1])
    ]
    return min(ways, key=lambda way: float(np.abs(way).max()))


@pytest.mark.parametrize(("board", "side", "kinds"), [(DOTS, 1.0, 1), (ASYMMETRIC, -1.0, 3)])
def test_dots_are_where_rays_say(board, side, kinds):
    where = drawn.pose((0.05, 0.3, -0.25), 0.45, board)
    camera, found = found_in(board, where, side, kinds)
    assert len(np.unique(found.corner)) > 0.6 * len(board.points())
    seen = geometry.dots(camera.numbers, board.points(), where, board.radius, in_views=False)
    way = off(found, camera, seen)
    assert np.sqrt((way**2).mean()) < 0.03
    assert np.abs(way.mean(0)).max() < 2e-3  # taken as the dots' own middles: 3 to 4e-3


def test_part_of_a_charuco_board_is_found_with_its_own_numbers():
    """Turned half round, which only markers tell, and moved out of the picture."""
    where = drawn.pose((np.pi, 0.3, -0.25), 0.45, CHARUCO) + np.array([0, 0, 0, 0, 4e-3, 6e-3])
    camera, found = found_in(CHARUCO, where, -1.0, 3)
    assert 6 <= len(np.unique(found.corner)) < 20
    way = found.place - camera.project(
        geometry.moved(CHARUCO.points(), where)[found.corner], found.center, found.kind
    )
    assert np.sqrt((way**2).mean()) < 0.05
    assert np.abs(way).max() < 0.15


def test_dots_in_views_are_where_rays_say():
    pytest.importorskip("cv2", reason="OpenCV finds the board")
    board = Board((3, 4), 3.8e-3, "dots")
    where = drawn.pose((0.05, 0.5, -0.4), 0.45, board)
    raw = RawImage(drawn_views.raw(where, np.random.default_rng(0), board=board))
    found = metrology.find_corners([raw], board, drawn_views.calibration(), in_views=True)
    assert np.bincount(found.corner).min() >= 9
    camera = drawn_views.CAMERA
    points = geometry.dots(camera.numbers, board.points(), where, board.radius, in_views=True)
    seen_at = found.place, found.center
    ways = [
        geometry.centers(camera.numbers, each[found.corner], seen_at, found.kind, drawn_views.PIXEL)
        - found.center
        for each in (points, points[::-1])
    ]
    way = min(ways, key=lambda way: float(np.abs(way).max())) / drawn_views.PITCH  # samples of a view
    assert np.sqrt((way**2).mean()) < 0.1
    assert np.abs(way.mean(0)).max() < 0.02


def printed(board, cut=0):
    """A picture of a ChArUco board, 24 samples a square, with `cut` columns of squares beyond its side."""
    y, x = (np.mgrid[: 24 * (n + 3)] / 24 - 2 + k * cut for k, n in enumerate(board.shape))
    at = np.stack(np.meshgrid(y, x, indexing="ij"), -1).reshape(-1, 2) * board.spacing
    picture = drawn.painted(at, np.full(len(at), board.spacing / 24), board)
    return picture.reshape(len(y), len(x))


@pytest.mark.parametrize("cut", [0, 3])
def test_corners_of_a_charuco_board_beyond_the_picture_have_no_place(cut):
    pytest.importorskip("cv2", reason="OpenCV finds the board")
    found = chessboard.find(printed(CHARUCO, cut), CHARUCO, "it").reshape(4, 5, 2)
    true = 24 * (np.stack(np.mgrid[:4, :5], -1) + np.array([2, 2 - cut]))
    assert np.isnan(found[:, : max(cut - 2, 0)]).all()
    assert np.abs(found - true)[:, cut:].max() < 0.1


def test_what_opencv_cannot_find_is_told():
    pytest.importorskip("cv2", reason="OpenCV finds the board")
    picture = printed(CHARUCO)
    with pytest.raises(CalibrationError, match=r"it does not show a whole board of 8 x 7 dots\. Leave"):
        chessboard.find(picture, DOTS, "it")
    with pytest.raises(
        CalibrationError, match=r"it shows \d of 20 corners of the ChArUco board of 5 x 4 .* but 6"
    ):
        chessboard.find(picture[:70, :90], CHARUCO, "it")
    other = Board((4, 5), 3.6e-3, "charuco", 2.7e-3, "DICT_9X9_9")
    with pytest.raises(
        LumigraphError, match="OpenCV has no dictionary DICT_9X9_9; one that it has is DICT_4X4"
    ):
        chessboard.find(picture, other, "it")
    large = Board((12, 9), 3.6e-3, "charuco", 2.7e-3, "DICT_4X4_50")
    with pytest.raises(LumigraphError, match="DICT_4X4_50 has 50 markers but the board 65"):
        chessboard.find(picture, large, "it")


def test_dots_too_close_to_each_other_are_refused():
    with pytest.raises(
        CalibrationError, match=r"on picture 2 .* are 4 px wide behind a lenslet, but 5\.7 are"
    ):
        windows.radius(np.array([9.0, 4.0, 8.0]), DOTS, 2, "px wide behind a lenslet")


def test_squares_are_as_wide_behind_a_lenslet_as_each_ones_patch_says() -> None:
    """Of a board that leans, far from the picture's corner: patches there take nothing from its squares."""
    places = np.mgrid[0:4, 0:4].reshape(2, -1).T * 40.0 + (600, 0)
    board = Board((4, 4), 1e-3)
    assert finding._CornerLines(np.arange(16), places, 103 / places[:, 0]).window(board, 0) == 2
    with pytest.raises(CalibrationError, match=r"squares, or ways between dots, are 5\.67 px wide"):
        finding._CornerLines(np.arange(16), places, 102 / places[:, 0]).window(board, 0)


def test_a_camera_measured_by_dots_survives_its_file_and_says_how_wide_they_were_taken(tmp_path):
    board = Board((5, 7), 10e-3, "dots")
    seen = scenes.corners(np.random.default_rng(0), frames=3)
    found = metrology.board(seen, board, scenes.NOMINAL)
    assert "dots are taken as 5 mm wide, half of their spacing" in " ".join(found.notes)
    metrology.save(found, tmp_path / "camera.json")
    assert metrology.load(tmp_path / "camera.json").board == found.board
    assert replace(found.board, heights=None) == board
    old = json.loads((tmp_path / "camera.json").read_text())
    old["board"] = {"shape": [5, 7], "spacing": 0.01}  # before there were dots
    (tmp_path / "camera.json").write_text(json.dumps(old))
    assert metrology.load(tmp_path / "camera.json").board == Board((5, 7), 0.01)
