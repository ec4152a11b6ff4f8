"""Corners found in raw images."""

import json

import numpy as np
import pytest

from lumigraph import io, metric
from lumigraph.cli import main
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.preparation import prepare
from metric import drawn

pytest.importorskip("cv2", reason="OpenCV finds the board")


def off(found, camera, where):
    """From the truth (n, 2) [px], with the board counted from either end."""
    points = metric.geometry.moved(drawn.BOARD.points(), where)
    ways = [
        found.place - camera.project(each[found.corner], found.center, found.kind)
        for each in (points, points[::-1])
    ]
    return min(ways, key=lambda way: float(np.abs(way).max()))


@pytest.mark.parametrize(("side", "kinds"), [(1.0, 1), (-1.0, 3)])
def test_corners_are_where_rays_say(side, kinds) -> None:
    camera, where = drawn.camera(side, kinds), drawn.pose((0.05, 0.3, -0.25))
    ready = prepare(drawn.raw(camera, where, kinds), drawn.calibration(kinds), white=drawn.white(kinds))
    found = metric.find_corners([ready], drawn.BOARD)
    way = off(found, camera, where)
    assert np.sqrt((way**2).mean()) < 0.03
    assert np.abs(way).max() < 0.1
    assert np.bincount(found.corner, minlength=20).min() >= 3


def test_a_picture_without_the_board_is_named() -> None:
    dull = np.random.default_rng(0).normal(0.5, 0.01, drawn.SHAPE).astype(np.float32)
    with pytest.raises(CalibrationError, match="picture 0 does not show a whole chessboard of 5 x 4"):
        metric.find_corners([dull], drawn.BOARD, drawn.calibration())


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
