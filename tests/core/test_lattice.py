import math

import numpy as np
import pytest

from lumigraph.core.lattice import Lattice
from lumigraph.errors import GeometryError


def test_square_neighbours_are_one_pitch_away_and_rows_turn_towards_y():
    lattice = Lattice.square(2.0, rotation=0.3, origin=(5.0, 7.0))
    row = lattice.position([0, 1]) - lattice.position([0, 0])
    np.testing.assert_allclose(row, [2 * math.sin(0.3), 2 * math.cos(0.3)])
    assert lattice.rotation == pytest.approx(0.3)
    assert lattice.cell_area == pytest.approx(4.0)
    np.testing.assert_allclose(lattice.position([0, 0]), [5.0, 7.0])


def test_a_hexagonal_lattice_has_six_neighbours_one_pitch_away():
    points = Lattice.hex(1.5, rotation=0.1).centers((-4, 4), (-4, 4))
    distances = np.sort(np.hypot(*points.T))
    np.testing.assert_allclose(distances[1:7], 1.5)
    assert distances[7] == pytest.approx(1.5 * math.sqrt(3))


def test_neighbours_of_three_kinds_never_share_a_kind():
    lattice = Lattice.hex(1.0, kinds=3)
    pairs = lattice.indices((-5, 5), (-5, 5))
    kinds, points = lattice.kind(*pairs.T), lattice.position(pairs)
    distance = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    touching = (distance > 0.5) & (distance < 1.1)
    assert touching.any()
    assert not (touching & (kinds[:, None] == kinds)).any()


def test_indices_lie_inside_the_closed_ranges_and_miss_none():
    assert len(Lattice.square(1.0).indices((-2, 2), (0, 3))) == 5 * 4


def test_a_negative_scale_turns_positions_but_keeps_the_row_along_x():
    lattice = Lattice.square(1.0, rotation=0.2, origin=(1.0, 2.0)).scaled(-3.0)
    assert lattice.rotation == pytest.approx(0.2)
    assert lattice.pitch == pytest.approx(3.0)
    assert lattice.origin == (-3.0, -6.0)


def test_moved_adds_to_the_origin():
    assert Lattice.square(1.0, origin=(1.0, 2.0)).moved(0.5, -1).origin == (1.5, 1.0)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Lattice(((0, 1), (0, 2))), "parallel: no lattice"),
        (
            lambda: Lattice(((0, 1), (1, 0)), layout="tri"),
            "layout is 'tri' but must be 'square', 'hex' or 'rectangular'",
        ),
        (lambda: Lattice(((0, 1), (1, 0)), kinds=3), "kinds is 3 but must be 1, or 3 in a 'hex' layout"),
        (lambda: Lattice.square(0.0), "pitch is 0 m but must be above 0 m"),
        (lambda: Lattice.square(1.0).scaled(math.nan), "factor is nan but must be a finite number"),
    ],
)
def test_a_lattice_refuses_what_no_lattice_has(build, message):
    with pytest.raises(GeometryError, match=message):
        build()
