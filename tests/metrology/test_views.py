"""Boards in views of cameras 1.0."""

import json
from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import io, metrology
from lumigraph.cli import main
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError, FormatError
from lumigraph.metrology.boards import geometry
from lumigraph.metrology.boards.noise import Noise
from lumigraph.metrology.boards.spill import Spill
from lumigraph.scene import targets
from metrology import drawn, drawn_views, scenes

TURNS = [
    (0.0, 0.0, 0.0),
    (0.05, 0.5, -0.2),
    (-0.05, -0.4, 0.3),
    (0.02, 0.1, 0.5),
    (0.1, -0.2, -0.5),
    (0.0, 0.3, 0.2),
]


def corners_off(found, where):
    """Centres from the truth (n, 2) [px], with the board counted from either end."""
    points = geometry.moved(drawn_views.BOARD.points(), where)
    seen_at = found.place, found.center
    ways = [
        geometry.centers(
            drawn_views.CAMERA.numbers, each[found.corner], seen_at, found.kind, drawn_views.PIXEL
        ) - found.center
        for each in (points, points[::-1])
    ]  # fmt: skip
    return min(ways, key=lambda way: float(np.abs(way).max()))


def moved_with(way, off):
    """How far places move for each pixel of the way of their views."""
    way = way - way.mean(0)
    return float((way * off).sum() / (way**2).sum())


def test_centres_of_views_undo_the_places_behind_lenslets() -> None:
    rng, camera = np.random.default_rng(2), scenes.CAMERA
    points = np.column_stack([rng.uniform(0.2, 0.4, 40), rng.uniform(-0.01, 0.01, (40, 2))])
    center, kind = rng.uniform(0, 3000, (40, 2)), rng.integers(0, 2, 40)
    place = camera.project(points, center, kind)
    again = geometry.centers(camera.numbers, points, (place, center), kind, camera.pixel_pitch)
    np.testing.assert_allclose(again, center, atol=1e-8)


def test_corners_in_views_are_where_rays_say() -> None:
    where = drawn.pose((0.05, 0.3, -0.25), 0.45, drawn_views.BOARD)
    raw = RawImage(drawn_views.raw(where, np.random.default_rng(0)))
    found = metrology.find_corners([raw], drawn_views.BOARD, drawn_views.calibration(), in_views=True)
    assert np.bincount(found.corner).min() >= 9
    off = corners_off(found, where) / drawn_views.PITCH  # samples of a view
    assert np.sqrt((off**2).mean()) < 0.1
    assert np.abs(off.mean(0)).max() < 0.02
    with pytest.raises(
        CalibrationError, match=r"not show a whole chessboard of 5 x 3 .* 12 corners of a board"
    ):
        metrology.find_corners([raw], metrology.Board((3, 5), 1e-3), drawn_views.calibration(), in_views=True)


def test_corners_between_markers_are_where_rays_say_in_views(monkeypatch) -> None:
    """Each by its number, in squares of 19 samples: windows as wide as a chessboard's are 0.25 off."""
    pytest.importorskip("cv2", reason="OpenCV reads the markers")
    monkeypatch.setattr(drawn_views, "SHAPE", shape := (round(91 * drawn_views.PITCH),) * 2)
    camera = replace(drawn_views.CAMERA, axis=(shape[0] / 2 + 3, shape[1] / 2 - 4))
    board = metrology.Board.from_text("3 x 3 charuco, 9.5 mm, markers 7.1 mm, DICT_4X4_50")
    where = drawn.pose((0.05, 0.2, -0.15), 0.45, board)
    raw = RawImage(drawn_views.raw(where, np.random.default_rng(0), board=board, seen_by=camera))
    found = metrology.find_corners([raw], board, drawn_views.calibration(), in_views=True)
    assert np.bincount(found.corner, minlength=9).min() >= 9
    points, seen_at = geometry.moved(board.points(), where)[found.corner], (found.place, found.center)
    true = geometry.centers(camera.numbers, points, seen_at, found.kind, drawn_views.PIXEL)
    off = (true - found.center) / drawn_views.PITCH  # samples of a view
    assert np.sqrt((off**2).mean()) < 0.06
    assert np.abs(off).max() < 0.15


@pytest.fixture(scope="module")
def measured():
    seen = scenes.corners_in_views(np.random.default_rng(7), frames=4, views=3)
    return metrology.board(seen, scenes.BOARD, scenes.NOMINAL)


def test_a_camera_1_0_comes_back_within_its_intervals(measured) -> None:
    off = np.abs(measured.camera.numbers - scenes.VIEWS_CAMERA.numbers)[:-1] / measured.errors[:-1]
    assert (off < 3).all()
    assert (off < 1.96).mean() > 0.8
    b = scenes.VIEWS_CAMERA.lenslet_distance
    assert measured.errors[2] < 0.02 * b  # the prior does not know it at all
    assert "f and L change the pictures alike" in " ".join(measured.notes)
    assert "this table of corners does not say by how much" in measured.notes[-1]


@pytest.mark.parametrize("distance", [0.3, 0.4075, 0.55])
def test_a_point_in_views_is_triangulated_within_its_error(measured, distance) -> None:
    """In the plane in focus too, where a corner does not move from view to view."""
    rng, camera, true = np.random.default_rng(3), scenes.VIEWS_CAMERA, np.array([distance, 0.01, -0.005])
    way = np.stack(np.meshgrid(*2 * [np.linspace(-6.5, 6.5, 7)]), -1).reshape(-1, 2)
    center = scenes.in_views(camera, true, way) + rng.normal(0, 0.4, way.shape)
    found = metrology.triangulate(measured, center + way, center, in_views=True)
    assert (np.abs(found.position - true) < 3 * found.errors).all()
    assert found.errors[0] < 0.04 * distance


def test_what_views_of_a_corner_share_by_their_way_is_found_and_taken_out() -> None:
    """Taken as independent, the slopes over the views would be 7 times as far off as said."""
    rng = np.random.default_rng(6)
    way = np.tile(np.stack(np.meshgrid(*2 * [np.linspace(-4, 4, 3)]), -1).reshape(-1, 2), (300, 1))
    sight, kind = np.repeat(np.arange(300), 9), np.zeros(2700, int)
    off = rng.normal(0, 0.1, (2700, 2)) + rng.normal(0, 0.05, 300)[sight, None] * way
    off += rng.normal(0, 0.2, (300, 2))[sight]
    found = Noise.of(off, sight, kind, way)
    assert (found.shared, found.sway) == (pytest.approx(0.2, rel=0.1), pytest.approx(0.05, rel=0.12))
    own = found.each(kind)
    plain, white = (one.whitened(off, sight, own, way) for one in (replace(found, sway=0.0), found))
    slopes = [
        np.add.reduceat((way * one).sum(1), np.arange(0, 2700, 9)) / np.sqrt(192) for one in (plain, white)
    ]
    assert np.std(slopes[1]) == pytest.approx(1, abs=0.15)
    assert np.std(slopes[0]) > 5
    derivatives = rng.normal(0, 1, (2700, 2, 4))
    alone = found.whitened(derivatives[..., 2], sight, own, way)
    np.testing.assert_allclose(found.whitened(derivatives, sight, own, way)[..., 2], alone)


def test_noise_that_a_camera_and_poses_follow_is_in_the_estimate() -> None:
    """Of 12 corners on each of 4 pictures they follow more than half of it."""
    board, found = metrology.Board((3, 4), 15e-3), []
    for seed in range(5):
        rng = np.random.default_rng([3, seed])
        seen = scenes.corners_in_views(rng, frames=4, views=3, noise=0.2, shared=0.15, board=board)
        found.append(metrology.board(seen, board, scenes.NOMINAL).noise)
    assert np.sqrt(np.mean([one.shared**2 for one in found])) == pytest.approx(0.15, rel=0.15)
    assert np.sqrt(np.mean([one.own[0] ** 2 for one in found])) == pytest.approx(0.2, rel=0.05)


def test_corners_in_views_survive_their_table(tmp_path) -> None:
    seen = scenes.corners_in_views(np.random.default_rng(1), frames=1, views=3)
    metrology.save_corners(seen, tmp_path / "corners.csv")
    again = metrology.load_corners(tmp_path / "corners.csv")
    assert again.in_views
    np.testing.assert_array_equal(again.center, seen.center)
    assert again[:3].in_views
    text = (tmp_path / "corners.csv").read_text()
    (tmp_path / "corners.csv").write_text(text.rstrip()[:-1] + "0\n")
    with pytest.raises(FormatError, match=r"column in_views of .* must hold 0 in all rows, or 1 in all"):
        metrology.load_corners(tmp_path / "corners.csv")
    assert not replace(seen, in_views=False)[:3].in_views


def test_tables_of_corners_in_views_tell_what_lenslets_spill(tmp_path) -> None:
    seen = scenes.corners_in_views(np.random.default_rng(1), frames=1, views=3)
    for lattice in (Lattice.square(20.0, 0.1), Lattice.hex(20.0, -0.02)):
        known = Spill(lattice, 0.9, 532e-9, 0.25)
        metrology.save_corners(replace(seen, spill=known), tmp_path / "corners.csv")
        again = metrology.load_corners(tmp_path / "corners.csv").spill
        assert (again.wavelength, again.fill, again.lattice.layout) == (532e-9, 0.9, lattice.layout)
        assert again.sharp == 0.25
        np.testing.assert_allclose(again.lattice.basis, lattice.basis, atol=1e-12)
    text = (tmp_path / "corners.csv").read_text()
    (tmp_path / "corners.csv").write_text(text.rstrip()[:-1] + "6\n")
    with pytest.raises(FormatError, match="column sharp must hold the same number in all rows"):
        metrology.load_corners(tmp_path / "corners.csv")


def test_a_point_in_views_is_triangulated_without_what_lenslets_spill(
    measured, tmp_path, monkeypatch
) -> None:
    """Spilt light moves it by several percent, and the camera's file tells of it."""
    camera, true = scenes.VIEWS_CAMERA, np.array([0.5, 0.01, -0.005])
    way = np.stack(np.meshgrid(*2 * [np.linspace(-6.5, 6.5, 7)]), -1).reshape(-1, 2)
    known = replace(measured, camera=camera, spill=Spill(Lattice.square(20.0), 1.0, 550e-9))
    metrology.save(known, tmp_path / "camera.json")
    known, rays, aside = metrology.load(tmp_path / "camera.json"), scenes.in_views(camera, true, way), 0.0
    for _ in range(4):
        one = metrology.Corners(
            *2 * [np.zeros(49, int)], rays + aside + way, rays + aside, np.zeros(49, int), True, known.spill
        )
        aside = aside + rays - one.cleared(camera).center
    found = metrology.triangulate(known, rays + aside + way, rays + aside, in_views=True)
    without = metrology.triangulate(
        replace(known, spill=None), rays + aside + way, rays + aside, in_views=True
    )
    assert found.position == pytest.approx(true, rel=1e-3)
    assert abs(without.position[0] - true[0]) > 0.005 * true[0]
    monkeypatch.setattr("lumigraph.metrology.boards.spill._UNSURE", 0.0)
    surer = metrology.triangulate(known, rays + aside + way, rays + aside, in_views=True)
    assert found.errors[0] > 1.001 * surer.errors[0]


@pytest.mark.long  # simulates a board by wave optics
@pytest.mark.parametrize("dz", [0.0, 30e-3])
def test_corners_in_views_are_where_wave_optics_puts_them(dz) -> None:
    camera = lg.PlenopticCamera(
        wavelength="550 nm", object_distance="450 mm", main_lens={"focal_length": "50 mm"},
        lenslets={"pitch": "100 um", "focal_length": "1.5 mm", "count": (41, 41)},
        sensor={"pixel_pitch": "7.7 um", "black_level": 64},
    )  # fmt: skip
    board, angle, middle = metrology.Board((3, 4), 5.4e-3), 0.1, np.array([0.4e-3, -0.3e-3])
    drawing = targets.chessboard(
        Grid.square(600, 40e-3 / 600), board.shape, 5.4e-3, angle=angle, position=middle
    )
    rng, sensor = np.random.default_rng(4), camera.sensor
    lights = [lg.simulate(camera, one, lg.Incoherent(1e-2)).data for one in (drawing.at(dz), targets.white())]
    raw, white = (sensor.expose(light, reference=lights[1].max(), fill=0.8, rng=rng) for light in lights)
    dark = sensor.expose(0 * lights[1], reference=1, rng=rng)
    ready = lg.prepare(raw, camera.calibration, white=white, dark=dark)
    found = metrology.find_corners([ready], board, in_views=True)
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flat = (board.points()[:, 1:] - (5.4e-3, 8.1e-3)) @ turned.T + middle
    points = np.column_stack([np.full(12, camera.object_distance + dz), flat])
    ideal, seen_at = metrology.MetricCamera.of(camera), (found.place, found.center)
    ways = [
        geometry.centers(ideal.numbers, each[found.corner], seen_at, found.kind, ideal.pixel_pitch)
        - found.center
        for each in (points, points[::-1])
    ]
    off = min(ways, key=lambda way: float(np.abs(way).max())) / camera.calibration.lattice.pitch
    assert np.sqrt((off**2).mean()) < 0.1
    set_right = found.cleared(ideal)
    each = points if np.abs(ways[0]).max() < np.abs(ways[1]).max() else points[::-1]
    seen_at = set_right.place, set_right.center
    rays = geometry.centers(ideal.numbers, each[found.corner], seen_at, found.kind, ideal.pixel_pitch)
    assert abs(moved_with(set_right.way, set_right.center - rays)) < 0.015
    assert moved_with(found.way, min(ways, key=lambda way: float(np.abs(way).max()))) > 0.02


@pytest.mark.long  # draws six raw images
def test_raw_images_of_a_camera_1_0_give_a_camera_by_one_command(tmp_path, capsys) -> None:
    rng, camera = np.random.default_rng(5), drawn_views.CAMERA
    io.save(RawImage(drawn_views.white()), tmp_path / "white.tif")
    names = [tmp_path / f"{k}.tif" for k in range(len(TURNS))]
    for k, (name, turn) in enumerate(zip(names, TURNS, strict=True)):
        where = drawn.pose(turn, 0.36 + 0.02 * k, drawn_views.BOARD)
        io.save(RawImage(drawn_views.raw(where, rng)), name)
    known = ["--focal-length", "50.5 mm", "--pixel-pitch", "5.5 um", "--board", "4 x 3 corners, 3.3 mm"]
    known += ["--wavelength", "1 nm"]  # rays spill nothing
    files = ["--white", str(tmp_path / "white.tif"), "-o", str(tmp_path / "camera.json"), "--in-views"]
    assert main(["board", *map(str, names), *known, *files, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["residual_px"] < 0.1 * drawn_views.PITCH
    for name in ("focal_length", "separation", "lenslet_distance"):
        low, high = found[f"{name}_interval"]
        assert abs(found[name] - getattr(camera, name)) < 3 / 1.96 * (high - low) / 2
    assert high - low < 0.15 * camera.lenslet_distance
