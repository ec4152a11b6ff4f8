"""Plans of pictures of a board."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import metric
from lumigraph.errors import CalibrationError
from lumigraph.metric import planning
from metric import drawn

NOMINAL = metric.Nominal(50e-3, drawn.PIXEL, drawn.SHAPE)


@pytest.fixture(scope="module")
def plan():
    return metric.plan(drawn.camera(-1.0), drawn.calibration(), drawn.BOARD, NOMINAL, pictures=6)


def test_the_errors_of_a_plan_are_those_of_the_pictures_taken(plan) -> None:
    rng, rows = np.random.default_rng(3), []
    for frame, step in enumerate(plan.steps):
        seen = planning._seen(
            plan.camera, drawn.calibration(), drawn.BOARD, drawn.pose(step.turn, step.distance)
        )
        shared = rng.normal(0, 0.05, (20, 2))[seen.corner]
        place = seen.place + rng.normal(0, 0.1, seen.place.shape) + shared
        rows.append((np.full(len(seen), frame), seen.corner, place, seen.center, seen.kind))
    taken = metric.Corners(*(np.concatenate(column) for column in zip(*rows, strict=True)))
    found = metric.board(taken, drawn.BOARD, NOMINAL)
    assert np.allclose(found.errors[:3], plan.steps[-1].errors, rtol=0.2)
    off = found.camera.numbers[:3] - plan.camera.numbers[:3]
    assert (np.abs(off) < 3 * np.array(plan.steps[-1].errors)).all()


def test_every_picture_of_a_plan_tells_more_and_tilted_ones_come_first(plan) -> None:
    errors = np.array([step.errors for step in plan.steps])
    assert (np.diff(errors, axis=0) <= 0).all()
    assert errors[-1, 2] < 0.5 * errors[0, 2]
    straight = planning._shot(
        plan.camera,
        drawn.calibration(),
        drawn.BOARD,
        metric.noise.Noise(np.array([0.1]), 0.05),
        0.45,
        (0.0, 0.0, 0.0),
    )
    (_, only), best = list(planning._chosen([straight], plan.camera, NOMINAL, 2)), plan.steps[1]
    assert sum(best.errors / plan.camera.numbers[:3]) < sum(only.errors / plan.camera.numbers[:3])


def test_the_ideal_camera_of_a_file_has_its_patches() -> None:
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    ideal = metric.MetricCamera.of(camera)
    assert ideal.magnification(camera.object_distance) == pytest.approx(0.5)
    point = np.array([[camera.object_distance, 0.0, 0.0]])
    center = camera.calibration.position(np.array([[0, 0], [0, 1]]))
    moved = np.diff(ideal.project(point, center) - center, axis=0)[0, 1]
    assert moved == pytest.approx(camera.patch_at(0.0), rel=1e-9)


def test_a_board_that_cannot_be_used_is_refused() -> None:
    with pytest.raises(
        CalibrationError, match=r"no place where the whole chessboard of 5 x 4 inner corners .*, 80 mm"
    ):
        metric.plan(drawn.camera(1.0), drawn.calibration(), metric.Board((4, 5), 80e-3), NOMINAL)
    with pytest.raises(CalibrationError, match="pictures is 2"):
        metric.plan(drawn.camera(1.0), drawn.calibration(), drawn.BOARD, NOMINAL, pictures=2)
