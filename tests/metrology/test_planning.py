"""Plans of pictures of a board."""

import dataclasses

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import metrology
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards import geometry, planning
from lumigraph.metrology.boards.noise import Noise
from metrology import drawn, drawn_views, scenes

NONE = np.zeros((0, 2))
NOMINAL = metrology.Nominal(50e-3, drawn.PIXEL, drawn.SHAPE)


@pytest.fixture(scope="module")
def plan():
    return metrology.plan(drawn.camera(-1.0), drawn.calibration(), drawn.BOARD, NOMINAL, pictures=6)


def before(camera):
    noise = Noise(np.array([0.1]), 0.05)
    return planning._Before(camera, drawn.calibration(), drawn.BOARD, noise, in_views=False)


def test_the_errors_of_a_plan_are_those_of_the_pictures_taken(plan) -> None:
    rng, rows = np.random.default_rng(3), []
    for frame, step in enumerate(plan.steps):
        points = geometry.moved(drawn.BOARD.points(), drawn.pose(step.turn, step.distance))
        seen = before(plan.camera).by_lenslets(points)
        shared = rng.normal(0, 0.05, (20, 2))[seen.corner]
        place = seen.place + rng.normal(0, 0.1, seen.place.shape) + shared
        rows.append((np.full(len(seen), frame), seen.corner, place, seen.center, seen.kind))
    taken = metrology.Corners(*(np.concatenate(column) for column in zip(*rows, strict=True)))
    found = metrology.board(taken, drawn.BOARD, NOMINAL)
    assert np.allclose(found.errors[:3], plan.steps[-1].errors, rtol=0.2)
    off = found.camera.numbers[:3] - plan.camera.numbers[:3]
    assert (np.abs(off) < 3 * np.array(plan.steps[-1].errors)).all()


def test_every_picture_of_a_plan_tells_more_and_tilted_ones_come_first(plan) -> None:
    errors = np.array([step.errors for step in plan.steps])
    assert (np.diff(errors, axis=0) <= 0).all()
    assert errors[-1, 2] < 0.5 * errors[0, 2]
    shots = (before(plan.camera).shot(distance, (0.0, 0.0, 0.35)) for distance in np.linspace(0.4, 1, 25))
    upright = next(filter(None, shots))
    (_, only), best = list(planning._chosen([upright], plan.camera, NOMINAL, 2)), plan.steps[1]
    assert sum(best.errors / plan.camera.numbers[:3]) < sum(only.errors / plan.camera.numbers[:3])


def test_a_plan_says_how_many_pictures_tell_a_length(plan) -> None:
    """f stays at the 2 % of its prior; b gets better with each."""
    part = 1.96 * plan.steps[3].errors[2] / plan.camera.numbers[2]
    assert plan.known[3, 2] == pytest.approx(part)
    assert plan.known[3, 3] == 1.96 * plan.steps[3].distance_error
    assert plan.enough(1.0001 * part)[2] == 4
    assert plan.enough(0.9999 * part)[2] == 5
    assert plan.enough(0.01)[0] is None


def test_the_ideal_camera_of_a_file_has_its_patches() -> None:
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    ideal = metrology.MetricCamera.of(camera)
    assert ideal.magnification(camera.object_distance) == pytest.approx(0.5)
    point = np.array([[camera.object_distance, 0.0, 0.0]])
    center = camera.calibration.position(np.array([[0, 0], [0, 1]]))
    moved = np.diff(ideal.project(point, center) - center, axis=0)[0, 1]
    assert moved == pytest.approx(camera.patch_at(0.0), rel=1e-9)


def test_a_board_that_cannot_be_used_is_refused() -> None:
    with pytest.raises(
        CalibrationError, match=r"no place where the whole chessboard of 5 x 4 inner corners .*, 80 mm"
    ):
        metrology.plan(drawn.camera(1.0), drawn.calibration(), metrology.Board((4, 5), 80e-3), NOMINAL)
    with pytest.raises(CalibrationError, match="pictures is 2"):
        metrology.plan(drawn.camera(1.0), drawn.calibration(), drawn.BOARD, NOMINAL, pictures=2)


def test_boards_are_in_the_picture_with_their_outer_squares_where_a_plan_puts_them(plan) -> None:
    """And half a square of the white margin, without which none is found; corners alone do not ask for it."""
    outer = np.array([(0.0, y, x) for y in (-1.5, 4.5) for x in (-1.5, 5.5)]) * drawn.BOARD.spacing
    centers = drawn.calibration().position(drawn.calibration().indices_within((0, 419), (0, 499)))
    for step in plan.steps:
        for point in geometry.moved(outer, drawn.pose(step.turn, step.distance)):
            way = np.hypot(*(plan.camera.project(point[None].repeat(len(centers), 0), centers) - centers).T)
            assert way.min() < 0.3 * drawn.PITCH  # the lenslet that shows it in its middle is there


@pytest.mark.parametrize("board", [scenes.BOARD, dataclasses.replace(scenes.BOARD, spacing=6e-3)])
def test_boards_in_views_can_be_found_where_pictures_are_off_their_plan(board) -> None:
    """By 2 % of the distance and 5° in every angle: squares are 5.7 samples wide, all corners are seen."""
    calibration = Calibration(
        Lattice.square(scenes.PITCH), scenes.NOMINAL.shape, NONE.astype(int), NONE, 0.0, fill=0.94
    )
    found = metrology.plan(scenes.VIEWS_CAMERA, calibration, board, scenes.NOMINAL, pictures=5, in_views=True)
    rng, least = np.random.default_rng(0), np.inf
    for step in found.steps:
        for _ in range(20):
            turn = np.array(step.turn) + np.radians(5) * rng.choice([-1, 1], 3)
            where = drawn.pose(tuple(turn), step.distance * (1 + 0.02 * rng.choice([-1, 1])), board)
            points = geometry.moved(board.points(), where)
            at = np.concatenate([scenes.in_views(scenes.VIEWS_CAMERA, p, np.zeros((1, 2))) for p in points])
            least = min(least, np.hypot(*(at[:, None] - at[None]).T)[~np.eye(35, dtype=bool)].min())
            assert (at > 3 * scenes.PITCH).all()
            assert (at < np.array(scenes.NOMINAL.shape) - 1 - 3 * scenes.PITCH).all()
    assert least / scenes.PITCH > 5.7


def test_a_plan_takes_the_views_that_boards_are_looked_for_in() -> None:
    """Also behind lenslets 11 pixels wide, where one of 13 was left."""
    nominal = metrology.Nominal(50e-3, drawn_views.PIXEL, drawn_views.SHAPE)
    camera, calibration, board = drawn_views.CAMERA, drawn_views.calibration(), drawn_views.BOARD
    found = metrology.plan(camera, calibration, board, nominal, pictures=3, in_views=True)
    raw = drawn_views.raw(drawn.pose((0.05, 0.3, -0.2), 0.4, board), np.random.default_rng(0))
    seen = metrology.find_corners([lg.RawImage(raw)], board, calibration, in_views=True)
    assert found.steps[0].places == 12 * np.bincount(seen.corner).max()


def test_a_pitch_that_is_known_makes_a_plan_tell_f() -> None:
    camera, exact = drawn.camera(1.0), (0.03, 0.03)
    ratio = 1 + camera.lenslet_distance / camera.exit_pupil
    known = dataclasses.replace(NOMINAL, pitch_ratio=ratio, pitch_ratio_error=1e-4)
    free, tied = (
        metrology.plan(camera, drawn.calibration(), drawn.BOARD, one, pictures=6, noise_px=exact)
        .steps[-1]
        .errors[0]
        for one in (NOMINAL, known)
    )
    assert tied < 0.6 * free


def test_a_plan_for_views_says_what_boards_in_views_will_tell() -> None:
    """Of a camera 1.0: b well, f and L no better than what is known of f, as the exit pupil is free."""
    camera = dataclasses.replace(scenes.VIEWS_CAMERA, tilt=(0.0, 0.0))
    none = np.zeros((0, 2))
    calibration = Calibration(
        Lattice.square(scenes.PITCH), scenes.NOMINAL.shape, none.astype(int), none, 0.0, fill=0.94
    )
    found = metrology.plan(camera, calibration, scenes.BOARD, scenes.NOMINAL, pictures=6, in_views=True)
    errors = np.array([step.errors for step in found.steps]) / camera.numbers[:3]
    assert errors[-1, :2] == pytest.approx(0.02, rel=0.1)
    assert errors[-1, 2] < min(0.0055, 0.5 * errors[0, 2])
    assert any(max(np.abs(step.turn)) > 0.6 for step in found.steps)
    own, shared = 0.012 * scenes.PITCH, 0.004 * scenes.PITCH
    before = planning._Before(camera, calibration, scenes.BOARD, Noise(np.ones(1), 0.0), True)
    rng, rows = np.random.default_rng(5), []
    for frame, step in enumerate(found.steps):
        where = drawn.pose(step.turn, step.distance, scenes.BOARD)
        seen = before.by_views(geometry.moved(scenes.BOARD.points(), where))
        edges = np.diff(seen.center[np.hypot(*seen.way.T) < 1e-9].reshape(5, 7, 2), axis=1).reshape(-1, 2)
        assert np.abs((np.degrees(np.arctan2(*edges.T)) + 45) % 90 - 45).min() > 17
        assert len(seen) == step.places
        off = rng.normal(0, own, seen.center.shape) + rng.normal(0, shared, (35, 2))[seen.corner]
        rows.append((np.full(len(seen), frame), seen.corner, seen.place + off, seen.center + off, seen.kind))
    columns = (np.concatenate(column) for column in zip(*rows, strict=True))
    measured = metrology.board(metrology.Corners(*columns, in_views=True), scenes.BOARD, scenes.NOMINAL)
    assert np.allclose(measured.errors[:3], found.steps[-1].errors, rtol=0.2)
    away = measured.camera.numbers[:3] - camera.numbers[:3]
    assert (np.abs(away) < 3.5 * np.array(found.steps[-1].errors)).all()
    way, far = np.stack(np.meshgrid(*2 * [np.linspace(-6, 6, 25)]), -1).reshape(-1, 2), []
    for distance in {step.distance for step in found.steps}:
        center = scenes.in_views(measured.camera, np.array([distance, 1e-3, 2e-3]), way)
        point = metrology.triangulate(measured, center + way, center, in_views=True)
        far.append(point.errors[0] / distance)
    assert max(far) == pytest.approx(found.steps[-1].distance_error, rel=0.2)
