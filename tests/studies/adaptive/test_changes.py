"""What beads' pixels tell together, against sums over the whole raw image."""

import numpy as np
import pytest

from lumigraph.studies.adaptive import fit
from lumigraph.studies.adaptive.changes import Changes, told
from lumigraph.studies.adaptive.images import OWN

SHAPE = (9, 12)
PARTS = [
    (slice(0, 4), slice(0, 5)), (slice(2, 7), slice(3, 12)), (slice(6, 9), slice(0, 3)),
    (slice(4, 4), slice(2, 2)),
]  # fmt: skip


def drawn(rng, unknowns):
    beads = [
        Changes(part, rng.normal(size=(unknowns, *(p.stop - p.start for p in part))), np.zeros(0))
        for part in PARTS
    ]
    whole = np.zeros((len(beads), unknowns, *SHAPE))
    for one, columns in zip(beads, whole, strict=True):
        columns[:, *one.part] = one.by
    return beads, whole.reshape(len(beads) * unknowns, -1)


def test_information_and_slope_are_those_of_all_pixels():
    rng = np.random.default_rng(3)
    beads, whole = drawn(rng, 3)
    weights, away = rng.uniform(0.5, 2, SHAPE), rng.normal(size=SHAPE)
    lights = rng.uniform(1, 9, len(beads))
    information, slope = told(beads, lights, weights, away)
    whole *= np.repeat(lights, 3)[:, None]
    np.testing.assert_allclose(information, whole * weights.ravel() @ whole.T, atol=1e-12)
    np.testing.assert_allclose(slope, whole @ away.ravel(), atol=1e-12)
    assert not information[:3, 6:].any()  # the first and the third light no pixel together


@pytest.mark.parametrize("terms", [1, 2])
def test_coefficients_at_beads_are_shared_between_nodes(terms):
    basis = np.array([[0.25, 0.75], [1.0, 0.0]])
    shared = fit._shared(basis, terms)
    own, nodes = np.arange(2.0 * OWN), np.arange(1.0, 1 + 2 * terms)
    found = (shared @ np.append(own, nodes)).reshape(2, OWN + terms)
    np.testing.assert_array_equal(found[:, :OWN], own.reshape(2, OWN))
    np.testing.assert_allclose(found[:, OWN:], basis @ nodes.reshape(2, terms))
