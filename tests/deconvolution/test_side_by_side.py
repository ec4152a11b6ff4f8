"""Raw images that share an operator's products: each as it is alone, whatever becomes of the others."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from deconvolution.models import blurred, disc
from lumigraph.core.linear import Linear
from lumigraph.deconvolution import Deconvolver, RichardsonLucy, Stop, TotalVariation
from lumigraph.deconvolution.side_by_side import side_by_side
from lumigraph.errors import CalibrationError

SHAPE = (14, 13)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Shared(Linear):
    """A blur that notes how many arrays it is given at a time, and fails when it is told to."""

    of: Linear = field(default_factory=lambda: blurred(SHAPE, 1.2))
    counts: list[int] = field(default_factory=list)
    failing: list[Exception] = field(default_factory=list)

    side_by_side = 4

    @property
    def shape(self):
        return self.of.shape

    def _forward(self, intensity):
        return self.of._forward(intensity)

    def _adjoint(self, raw):
        return self.of._adjoint(raw)

    def _forwards(self, intensities):
        self.counts.append(len(intensities))
        if self.failing and len(self.counts) > 3:
            raise self.failing[0]
        return [self._forward(one) for one in intensities]


@pytest.fixture
def raws(rng):
    light = blurred(SHAPE, 1.2).forward(disc(SHAPE))
    return [rng.poisson(light * k).astype(np.float32) for k in (0.05, 0.3, 1, 4)]


@pytest.mark.parametrize(
    "method",
    [RichardsonLucy(), RichardsonLucy(TotalVariation(0.02), accelerated=True)],
    ids=["plain", "prior"],
)
def test_each_is_what_it_is_alone_though_they_stop_at_different_times(method, raws):
    engine = Deconvolver(Shared(), Stop(60, change=0.02), method=method)
    expected = [engine(raw) for raw in raws]
    counts = engine.operator.counts
    assert not counts
    found = engine.several(raws, [None] * 4)
    np.testing.assert_array_equal(found, expected)
    assert counts[0] == 4
    assert counts == sorted(counts, reverse=True)
    assert len(set(counts)) > 1  # some had ended before others


def test_a_raw_image_that_cannot_be_explained_has_an_error_and_the_others_none(raws):
    engine = Deconvolver(Shared(), 5)
    expected, bad = [engine(raw) for raw in raws], raws[1].copy()
    bad[2, 3] = np.nan
    found = engine.several([raws[0], bad, 0 * raws[1], raws[3]], [None] * 4)
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[3], expected[3])
    for error, told in ((found[1], "NaN"), (found[2], "dark")):
        assert isinstance(error, CalibrationError)
        assert told in str(error)


def test_an_operator_that_fails_ends_each_with_its_error(raws):
    engine, failure = Deconvolver(Shared(), 9), MemoryError("too large")
    engine.operator.failing.append(failure)
    assert engine.several(raws, [None] * 4) == [failure] * 4
    assert len(engine.operator.counts) == 4  # none went on


def test_an_interruption_of_one_ends_all():
    rounds = []

    def endless(operator):
        while True:
            rounds.append(operator.forward(np.ones(SHAPE)))

    def interrupted(operator):
        operator.forward(np.ones(SHAPE))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        side_by_side(Shared(), [interrupted, endless, endless])
    assert len(rounds) < 1000


def test_none_are_taken_together_where_starts_are_warm(raws):
    assert Deconvolver(Shared(), 5).side_by_side == 4
    assert Deconvolver(Shared(), 5, warm=True).side_by_side == 1
    assert Deconvolver(blurred(SHAPE, 1.2), 5).side_by_side == 1
