"""Light that lenslets spill into their neighbours' micro-images, and boards seen through it."""

from dataclasses import replace

import numpy as np
import pytest

from lumigraph import metric
from lumigraph.core.lattice import Lattice
from lumigraph.errors import GeometryError
from lumigraph.metric.spill import Spill
from metric import scenes

PITCH, WAYS = 20.0, np.array([[0.0, 0.0], [0.0, 2.0], [3.0, -1.0], [-3.0, 1.0]])
SQUARE = Spill(Lattice.square(PITCH), 1.0, 550e-9)


def direct(way, slope, width, n=201):
    """(y, x) [px], by sums over the stop of what square lenslets diffract, one by one."""
    at = (np.arange(n) - n // 2) / n
    stop = np.hypot(at[:, None], at) <= 0.5
    light, aside = 0.0, np.zeros(2)
    for k in np.argwhere(np.ones((7, 7), bool)) - 3:
        y, x = (way[axis] / PITCH - k[axis] - at for axis in (0, 1))
        own = np.sinc(y / width)[:, None] ** 2 * np.sinc(x / width) ** 2 * stop
        direction = np.array([own.sum(1) @ at, own.sum(0) @ at]) / own.sum()
        ghost = k - slope * (direction - way / PITCH)
        light += own.sum()
        aside -= own.sum() * ghost / max(1.0, float(np.hypot(*ghost)))
    return aside * PITCH / light


@pytest.mark.parametrize("width", [0.06, 0.12])
@pytest.mark.parametrize("slope", [0.0, 1.5, -1.5])
def test_views_are_moved_by_the_light_of_each_neighbour(width, slope) -> None:
    expected = np.array([direct(way, slope, width) for way in WAYS])
    found = SQUARE.aside(WAYS, np.full(len(WAYS), slope), width)
    assert found == pytest.approx(expected, rel=0.03, abs=2e-3)


def test_what_is_in_focus_is_moved_towards_the_middle_as_wave_optics_moves_it() -> None:
    """By 0.065 and 0.032 of the way on flat boards, at a quarter of a lenslet from the middle."""
    way = np.array([[0.0, PITCH / 4]])
    for width, measured in ((0.123, 0.065), (0.0614, 0.032)):
        found = SQUARE.aside(way, np.zeros(1), width)
        assert found[0, 1] / way[0, 1] == pytest.approx(-measured, rel=0.2)


def test_turned_lenslets_turn_what_they_spill() -> None:
    turned = replace(SQUARE, lattice=Lattice.square(PITCH, 0.3))
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    slope = np.full(len(WAYS), 0.7)
    found = turned.aside(WAYS @ turn.T, slope, 0.1)
    assert found == pytest.approx(SQUARE.aside(WAYS, slope, 0.1) @ turn.T, abs=1e-9)


def test_hexagons_spill_alike_in_six_directions() -> None:
    hexagons = Spill(Lattice.hex(PITCH), 1.0, 550e-9)
    ways = 3 * np.array([[np.sin(a), np.cos(a)] for a in np.arange(6) * np.pi / 3])
    moved = hexagons.aside(ways, np.zeros(6), 0.1)
    assert np.hypot(*moved.T) == pytest.approx(np.hypot(*moved[0]), rel=0.03)
    assert (moved * ways).sum(1).max() < 0


def test_nothing_is_spilt_where_waves_are_short() -> None:
    assert np.abs(SQUARE.aside(WAYS, np.ones(len(WAYS)), 1e-4)).max() < 2e-3 * PITCH


def test_a_wavelength_of_nothing_is_refused() -> None:
    with pytest.raises(GeometryError, match="wavelength is 0"):
        Spill(Lattice.square(PITCH), 1.0, 0.0)


def test_a_board_seen_through_spilt_light_gives_the_camera_and_how_sure_it_is() -> None:
    camera, seen = scenes.VIEWS_CAMERA, scenes.corners_in_views(np.random.default_rng(7), frames=6, views=5)
    spill = Spill(Lattice.square(PITCH), 1.0, 400e-9)
    spilt = seen
    for _ in range(4):  # what is seen so that `cleared` leaves it where rays put it
        spilt = replace(
            spilt, center=spilt.center + seen.center - replace(spilt, spill=spill).cleared(camera).center
        )
        spilt = replace(spilt, place=spilt.center + seen.way)
    without, allowed = (
        metric.board(replace(spilt, spill=one), scenes.BOARD, scenes.NOMINAL) for one in (None, spill)
    )
    b = camera.lenslet_distance
    assert abs(without.camera.lenslet_distance - b) > 3 * without.errors[2]
    assert abs(allowed.camera.lenslet_distance - b) < 2 * allowed.errors[2]
    assert allowed.errors[2] < 3 * without.errors[2]
    assert "allowed for by diffraction at 400 nm, to 15%" in allowed.notes[-1]
    located = allowed.locate(replace(spilt, spill=spill)[spilt.frame == 0])[0]
    assert located.residual_px < 1.3 * allowed.poses[0].residual_px
