"""Steps of a fit whose images are Gaussian spots, moved along x by the one coefficient."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.deconvolution import Exposure
from lumigraph.deconvolution.problem import Problem, Scale
from lumigraph.operators.microscope.pupil import PupilPointImage
from lumigraph.operators.sampling.resampling import Part
from lumigraph.scene import Points
from lumigraph.studies.adaptive import fit
from lumigraph.studies.adaptive.field import FieldNodes
from lumigraph.studies.adaptive.fit import BeadFit, Model
from lumigraph.studies.adaptive.star import StarOperator

Y, X = np.mgrid[-10.0:11, -10.0:11]
LIGHT, MOVED = 500.0, 0.7
"""Of the bead that is seen, and where the coefficient puts it."""


@dataclass
class Spots:
    """Images of which derivatives may be off by a factor; how often either is asked for is counted."""

    off: float = 1.0
    wide: float = 1.0
    moved: float = 0.0
    calls: dict[str, int] = field(default_factory=lambda: {"image": 0, "changes": 0})
    shape = X.shape

    def forward(self, points: Points, coefficients: np.ndarray) -> np.ndarray:
        y, x, _ = points.positions[0]
        far = (Y - y) ** 2 + (X - x - self.moved - coefficients.sum()) ** 2
        return points.intensities[0] * np.exp(-far / 8 / self.wide)

    def lit(
        self, points: Points, coefficients: np.ndarray, directions: np.ndarray | None = None
    ) -> Iterator[PupilPointImage]:
        image = self.forward(Points(points.positions, np.ones(1)), coefficients)
        changes = np.zeros((len(coefficients) + 3, *self.shape))  # the bead's place is known
        if len(coefficients):
            changes[0] = self.off * image * (X - points.positions[0, 1] - coefficients[0]) / 4
        self.calls["changes" if directions is None else "image"] += 1
        yield PupilPointImage(
            image, changes if directions is None else np.tensordot(directions, changes, 1), (0, 0)
        )

    def fixed(self, coefficients: np.ndarray) -> "Spots":
        return replace(self, moved=self.moved + float(coefficients[0]))

    def seen(self, images: np.ndarray, cell: tuple[int, int]) -> tuple[Part, np.ndarray]:
        return (slice(0, len(Y)), slice(0, len(X))), images


def bead(light: float) -> Points:
    return Points(np.zeros((1, 3)), np.array([light]))


@pytest.fixture
def model():
    spots = Spots()
    data = np.random.default_rng(5).poisson(spots.forward(bead(LIGHT), np.array([MOVED])) + 1.0) * 1.0
    exposure = Exposure(background=1.0, gain=1.0)
    scale = Scale.of(StarOperator(spots.forward(bead(1.0), np.zeros(1))), exposure, data)
    nodes, held = FieldNodes.of(Grid.square(21, 1.0), (1, 1), 1), np.zeros(3)
    return Model(spots, Problem.of(data, exposure, scale), nodes, (held, held))


def test_a_step_that_gains_more_than_promised_is_doubled(model):
    first, fixed = BeadFit(bead(30 * LIGHT), np.array([[MOVED]])), np.zeros(1, bool)
    found = model.improved(first, fixed, 1)
    taken = np.log(found.points.intensities[0] / first.points.intensities[0])
    assert taken < -1.5  # one step is 1 at most
    e_fold = replace(first, points=bead(30 * LIGHT / np.e))
    assert found.objective < model.judged(e_fold).objective


@pytest.mark.parametrize("off", [0.8, 1.3])
def test_coarse_derivatives_show_the_way_to_the_same_place(model, off):
    start, free = BeadFit(bead(LIGHT / 2), np.zeros((1, 1))), np.ones(1, bool)
    exact = model.improved(start, free, 40)
    coarse = Spots(off)
    found = replace(model, coarse=coarse).improved(start, free, 40)
    assert coarse.calls["changes"] > 1
    deviation = 1 / np.sqrt(model.around(exact).information[-1, -1])
    assert abs(found.coefficients[0, 0] - exact.coefficients[0, 0]) < 0.3 * deviation
    assert abs(exact.coefficients[0, 0] - MOVED) < 3 * deviation
    assert found.points.intensities[0] == pytest.approx(exact.points.intensities[0], rel=5e-3)


@pytest.mark.parametrize("wide", [0.9, 1.1])
def test_coarse_images_judge_the_first_steps_alone(model, wide):
    start, free = BeadFit(bead(LIGHT / 2), np.zeros((1, 1))), np.ones(1, bool)
    exact, coarse = model.improved(start, free, 40), Spots(wide=wide)
    fine = Spots()
    found = replace(model, images=fine, coarse=coarse).fitted(start, free, 40)
    assert fine.calls["changes"] == 0
    assert fine.calls["image"] < coarse.calls["image"]
    assert found.objective == pytest.approx(model.judged(found.changed()).objective)
    assert found.objective < exact.objective + 2 * fit.GAIN
    assert replace(model, images=coarse).improved(start, free, 40).objective > exact.objective + 10


def test_short_steps_go_on_the_way_of_the_last_two(model, monkeypatch):
    found, asked = [], []
    for least in (fit.CURVED, np.inf):
        monkeypatch.setattr(fit, "CURVED", least)
        steep = Spots(5.0)  # steps are a fifth of what they should be
        start = BeadFit(bead(LIGHT), np.zeros((1, 1)))
        found.append(replace(model, coarse=steep).improved(start, np.ones(1, bool), 60))
        asked.append(steep.calls["changes"])
    assert asked[0] < 0.7 * asked[1]
    assert found[0].objective < found[1].objective + 2 * fit.GAIN


def test_what_a_fit_leaves_over_noise_is_one_at_the_truth_and_more_beside_it(model):
    exact, beside = (model.judged(BeadFit(bead(LIGHT), np.full((1, 1), c))) for c in (MOVED, MOVED + 0.5))
    assert model.misfit(exact).pearson == pytest.approx(1, abs=0.25)  # 3 deviations of 441 pixels
    assert model.misfit(beside).pearson > 2


def test_derivatives_of_beads_that_hardly_changed_are_kept(model):
    at = model.known(BeadFit(bead(LIGHT), np.full((1, 1), MOVED)))
    for change, kept in ((0.5, True), (2.0, False)):
        moved = at.changed(coefficients=at.coefficients + change * fit.STALE * model.longest[-1])
        slope, fresh = model.around(moved).slope, model.around(replace(moved, beads=())).slope
        assert (model.known(moved).beads[0] is at.beads[0]) == kept
        assert slope == pytest.approx(fresh, rel=0.05, abs=0.05 * np.abs(fresh).max())
    brighter = at.changed(points=bead(2 * LIGHT))
    assert model.known(brighter).beads[0] is at.beads[0]
    told, fresh = (model.around(one).information[3, 3] for one in (brighter, replace(brighter, beads=())))
    assert told == pytest.approx(fresh)


def test_beads_find_their_derivatives_when_others_leave(model):
    two = Points(np.array([[0.0, 0.0, 0.0], [3.0, -2.0, 0.0]]), np.full(2, LIGHT))
    both = model.known(BeadFit(two, np.full((1, 1), MOVED)))
    one = both.changed(points=Points(two.positions[1:], two.intensities[1:]))
    assert model.known(one).beads == both.beads[1:]


def test_beads_are_placed_through_a_wavefront_that_is_known(model):
    start = BeadFit(bead(LIGHT / 3), np.array([[MOVED]]), steps=2)
    placed, free = model.placed(start, 20), model.improved(start, np.zeros(1, bool), 20)
    assert placed.points.intensities[0] == pytest.approx(free.points.intensities[0], rel=1e-3)
    assert placed.coefficients == pytest.approx(start.coefficients)
    assert placed.objective == pytest.approx(free.objective)
    assert placed.steps == free.steps > 2


def test_what_pixels_add_to_a_slope_adds_up_to_it(model):
    at, rng = BeadFit(bead(LIGHT), np.full((1, 1), MOVED + 0.3)), np.random.default_rng(0)
    mixed = rng.normal(size=(5, 2))
    scores = model.scores(at, mixed)
    assert scores.shape == (2, *X.shape)
    assert scores.sum((1, 2)) == pytest.approx(mixed.T @ model.around(at).slope, rel=1e-3)


def test_spread_stays_above_0(model):
    balls = replace(model, unit=1.0)
    found = balls._moved(BeadFit(bead(LIGHT), np.full((1, 1), 0.1)), np.append(np.zeros(4), -0.5))
    assert found.coefficients == 0
    assert model._moved(found, np.append(np.zeros(4), -0.5)).coefficients == -0.5
