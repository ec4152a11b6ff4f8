"""Corners found in raw images."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.signal import fftconvolve
from scipy.spatial import KDTree

import lumigraph as lg
from lumigraph import io, metrology
from lumigraph.analysis.chart import find_chart
from lumigraph.analysis.crossings import crossed
from lumigraph.analysis.pupil_edge import PupilEdge
from lumigraph.cli import main
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards import chessboard, finding, geometry
from lumigraph.preparation import prepare
from lumigraph.scene import targets
from metrology import drawn

pytest.importorskip("cv2", reason="OpenCV finds the board")


def off(found, camera, where):
    """From the truth (n, 2) [px], with the board counted from either end."""
    points = geometry.moved(drawn.BOARD.points(), where)
    ways = [
        found.place - camera.project(each[found.corner], found.center, found.kind)
        for each in (points, points[::-1])
    ]
    return min(ways, key=lambda way: float(np.abs(way).max()))


@pytest.mark.parametrize(("side", "kinds"), [(1.0, 1), (-1.0, 3)])
def test_corners_are_where_rays_say(side, kinds) -> None:
    camera, where = drawn.camera(side, kinds), drawn.pose((0.05, 0.3, -0.25))
    ready = prepare(drawn.raw(camera, where, kinds), drawn.calibration(kinds), white=drawn.white(kinds))
    found = metrology.find_corners([ready], drawn.BOARD)
    way = off(found, camera, where)
    assert np.sqrt((way**2).mean()) < 0.03
    assert np.abs(way).max() < 0.1
    assert np.bincount(found.corner, minlength=20).min() >= 3


@pytest.mark.parametrize("misses", [True, False])
def test_a_whole_chessboard_that_opencv_misses_or_gets_wrong_is_found(misses, monkeypatch) -> None:
    """As it did one of 136 samples, rendered sharp all over, and one corner of a picture in four."""
    import cv2

    board, cell, (c, s) = metrology.Board((3, 4), 2e-3), 17.6, (np.cos(0.05), np.sin(0.05))
    turned, middle = np.array([[c, -s], [s, c]]), np.array([70.5, 64.8])
    flat = board.points()[:, 1:] - board.points()[:, 1:].mean(0)
    y, x = np.indices((137, 137)).reshape(2, -1)
    at = (np.column_stack([y, x]) - middle) @ turned * (2e-3 / cell) + board.points()[:, 1:].mean(0)
    picture = drawn.squares(at, np.full(len(at), 2e-3 / cell), board).reshape(137, 137)
    true = flat @ turned.T * (cell / 2e-3) + middle
    answer = true[:, None, ::-1].astype(np.float32)
    answer[9, 0, 0] += cell / 2
    monkeypatch.setattr(
        cv2, "findChessboardCornersSB", lambda *_, **__: (False, None) if misses else (True, answer)
    )
    found = chessboard.find(picture, board, "it")
    assert min(np.abs(found - one).max() for one in (true, true[::-1])) < 0.1
    message = "it does not show a whole chessboard of 4 x 3" if misses else "no flat board in any order"
    with pytest.raises(CalibrationError, match=message):
        chessboard.find(picture[:80], board, "it")


def test_the_rim_of_a_micro_image_pulls_at_corners_beyond_the_clear_radius_alone() -> None:
    """Outwards: of a lenslet's beam the stop leaves less there, so that an edge's inner side is brighter."""
    none, ratio, fine = np.zeros((0, 2)), 0.3, 5
    pitch, fill = 22.64, 0.82
    known = Calibration(Lattice.hex(pitch), (31, 31), none.astype(int), none, 0.0, fill=fill)
    y, x = np.meshgrid(*2 * [(np.arange(31 * fine) + 0.5) / fine - 15.5], indexing="ij")
    stop, beam = np.hypot(y, x) < fill * pitch / 2, np.hypot(y, x) < ratio * pitch / 2
    light = fftconvolve(stop, beam / beam.sum(), mode="same")

    def pulled(away: float) -> float:
        down, right = y, x - away
        one, other = 0.34 * right + 0.94 * down, 0.94 * right - 0.34 * down
        seen, white = (
            gaussian_filter(part, 0.8 * fine).reshape(31, fine, 31, fine).mean((1, 3))
            for part in (light * (0.5 + 0.4 * np.sign(one) * np.sign(other)), light)
        )
        return float(crossed(seen / white, np.array([[15.0, 15 + away]]), 2)[0, 1] - 15 - away)

    clear, lit = finding.clear_radius(known, np.array([ratio]))[0], finding.lit_radius(known)
    assert lit - clear > 0.7
    assert 0 < pulled(clear) < 0.012
    assert pulled(lit) > 0.02


@pytest.mark.parametrize(("turn", "away", "saddles"), [(0.52, -1.0, 13), (0.7, -2.0, 14)])
def test_saddles_between_a_board_and_a_dark_rim_are_none_of_its_corners(turn, away, saddles) -> None:
    """As of the array on views: the tip of a square near it makes one."""
    board, fine, (c, s) = metrology.Board((3, 4), 6.6), 5, (np.cos(turn), np.sin(turn))
    y, x = np.meshgrid(*2 * [(np.arange(47 * fine) + 0.5) / fine - 23.5], indexing="ij")
    at = np.stack([c * y - s * x, s * y + c * x + away], -1).reshape(-1, 2) + board.middle[1:]
    picture = drawn.squares(at, np.full(len(at), 0.2), board).reshape(47, fine, 47, fine).mean((1, 3))
    picture[:3] = picture[-3:] = picture[:, :3] = picture[:, -3:] = 0
    assert len(find_chart(picture)) == saddles
    found, _ = chessboard.whole(picture, board)
    flat = board.points()[:, 1:] - board.middle[1:] - (0, away)
    true = flat @ np.array([[c, -s], [s, c]]) + 23
    assert np.asarray(KDTree(true).query(found)[0]).max() < 0.2
    assert len(np.unique(KDTree(true).query(found)[1])) == 12


def test_the_board_tells_the_sign_of_the_patches(monkeypatch) -> None:
    """Its squares repeat: patches of either sign may explain them about as well."""
    known = finding.of_signs

    def wrong_first(raw, calibration):
        (right,) = known(raw, calibration)
        low, high = right.ends
        return [replace(right, ends=(-high, -low), sizes=-right.sizes), right]

    camera, where = drawn.camera(1.0, 1), drawn.pose((0.05, 0.3, -0.25))
    ready = prepare(drawn.raw(camera, where, 1), drawn.calibration(1), white=drawn.white(1))
    sure = metrology.find_corners([ready], drawn.BOARD)
    monkeypatch.setattr(finding, "of_signs", wrong_first)
    assert np.array_equal(metrology.find_corners([ready], drawn.BOARD).place, sure.place)


def test_a_picture_without_the_board_is_named() -> None:
    dull = np.random.default_rng(0).normal(0.5, 0.01, drawn.SHAPE).astype(np.float32)
    with pytest.raises(CalibrationError, match="picture 0 does not show a whole chessboard of 5 x 4"):
        metrology.find_corners([dull], drawn.BOARD, drawn.calibration())


@pytest.mark.long  # simulates a board by wave optics
@pytest.mark.parametrize(
    ("magnified", "focal", "dz"), [(0.3, "1.2 mm", 0.0), (-0.3, "2.4 mm", 8e-3)]
)  # at 1.2 mm the lens of f/8 takes four minutes
def test_corners_are_where_wave_optics_puts_them(magnified, focal, dz) -> None:
    camera = lg.FocusedPlenopticCamera(
        wavelength="550 nm", object_distance="450 mm", main_lens={"focal_length": "50 mm"},
        lenslets={"pitch": "100 um", "focal_length": focal, "count": (17, 17), "magnification": magnified},
        sensor={"pixel_pitch": "4 um"},
    )  # fmt: skip
    board, angle, middle = metrology.Board((3, 4), 2e-3), 0.05, np.array([0.4e-3, -0.3e-3])
    drawing = targets.chessboard(
        Grid.square(480, 16e-3 / 480), board.shape, 2e-3, angle=angle, position=middle
    )
    raw, white = (
        lg.simulate(camera, scene, lg.Incoherent(1e-2)) for scene in (drawing.at(dz), targets.white())
    )
    found = metrology.find_corners([lg.prepare(raw, camera.calibration, white=white)], board)
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flat = (board.points()[:, 1:] - (2e-3, 3e-3)) @ turned.T + middle
    points = np.column_stack([np.full(12, camera.object_distance + dz), flat])
    ideal = metrology.MetricCamera.of(camera)
    ways = [
        found.place - ideal.project(each[found.corner], found.center, found.kind)
        for each in (points, points[::-1])
    ]
    assert min(float(np.sqrt((way**2).mean())) for way in ways) < 0.1


@pytest.mark.long  # draws and searches five raw images
def test_raw_images_give_a_camera_by_one_command(tmp_path, capsys) -> None:
    camera = drawn.camera(-1.0, 3)
    turns = [(0.0, 0.0, 0.0), (0.05, 0.4, -0.2), (-0.05, -0.4, 0.1), (0.02, 0.1, 0.45), (0.0, -0.2, -0.45)]
    io.save(RawImage(drawn.white(3)), tmp_path / "white.tif")
    names = [tmp_path / f"{k}.tif" for k in range(len(turns))]
    for k, (name, turn) in enumerate(zip(names, turns, strict=True)):
        io.save(RawImage(drawn.raw(camera, drawn.pose(turn, 0.44 + 0.005 * k), 3)), name)
    known = ["--focal-length", "50.5 mm", "--pixel-pitch", "5.5 um", "--board", "5 x 4 corners, 2.8 mm"]
    files = ["--white", str(tmp_path / "white.tif"), "-o", str(tmp_path / "camera.json")]
    assert main(["board", *map(str, names), *known, *files, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["residual_px"] < 0.1
    for name in ("focal_length", "separation", "lenslet_distance"):
        low, high = found[f"{name}_interval"]
        assert low < getattr(camera, name) < high


@pytest.mark.parametrize(("width", "told"), [(0.9, ((0.9, 0.1),)), (0.98, ())])
def test_edges_of_micro_images_that_touch_tell_nothing(width, told, monkeypatch) -> None:
    edge = PupilEdge(20.0, 20 * width, 0.0, 2.0, 0.0, np.zeros(1), np.zeros(1))
    monkeypatch.setattr(finding, "pupil_edge", lambda *_: edge)
    ready = lg.prepare(np.ones(drawn.white(1).shape), drawn.calibration(1), white=drawn.white(1))
    assert finding._edges(ready, drawn.calibration(1)) == told
