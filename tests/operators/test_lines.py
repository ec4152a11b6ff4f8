"""Lenslets of any shape, one after the other: which of them are followed, and how far."""

import numpy as np
import pytest

import cameras
from lumigraph.operators.lenslets import individual, line_matrices
from lumigraph.operators.lenslets.any_shape import AnyShape
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.lenslets.relay import RelaySet
from lumigraph.operators.sampling.optics import Optics
from lumigraph.scene import Points
from lumigraph.units import mm, um

WIDE = cameras.focused(
    count=(15, 15), layout="hex", focal_length=(5.2 * mm, 5.0 * mm, 5.4 * mm), pixel_pitch=6 * um
).replace(main_lens={"diameter": 6 * mm})
POINT = Points(np.array([[0.1 * mm, -0.05 * mm, 1 * mm]]), np.ones(1))


@pytest.fixture
def followed(monkeypatch):
    """Numbers of lenslets around the cells that a point lights, and of those that are followed."""
    numbers, of = [], AnyShape.lit

    def counted(self, light, cells):
        found = of(self, light, cells)
        numbers.append((len(self._around(*cells)), sum(map(len, found))))
        return found

    monkeypatch.setattr(AnyShape, "lit", counted)
    return numbers


def test_lenslets_that_a_point_leaves_dark_are_not_followed(followed, monkeypatch):
    camera = WIDE.replace(lenslets={"pitch": 0.3 * mm})
    few = points_image(camera, POINT, 1e-2)
    monkeypatch.setattr(individual, "DARK", 0.0)
    whole = points_image(camera, POINT, 1e-2)
    (around, lit), (_, all_lit) = followed
    assert lit < around / 2
    assert all_lit == around
    assert 0 < np.linalg.norm(few - whole) < 0.2e-2 * np.linalg.norm(whole)


def test_a_dark_array_has_a_dark_image():
    relay = AnyShape(Optics.of(WIDE, WIDE.object_distance, 1e-2))
    y, x = relay.places(range(2), range(2))
    assert not relay.field(np.zeros((len(y), len(x))), range(2), range(2)).any()


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
def test_light_that_is_followed_farther_changes_images_by_less_than_was_asked(accuracy, monkeypatch):
    camera = WIDE.replace(lenslets={"pitch": 0.2 * mm, "count": (9, 9)})
    image = points_image(camera, POINT, accuracy)
    monkeypatch.setattr(line_matrices, "ASIDE", (3.0, 0.0))
    farther = points_image(camera, POINT, accuracy)
    assert np.linalg.norm(image - farther) < accuracy * np.linalg.norm(farther)


def test_depths_share_what_lenslets_do_where_they_are_followed_alike_alone():
    camera = WIDE.replace(lenslets={"pitch": 0.3 * mm, "count": (5, 5)}, main_lens={"diameter": 10 * mm})
    optics = camera.optics()
    known, places = RelaySet(optics.object_distance + 6 * mm), np.array([[0.1 * mm, 0.0]])
    near, middle, far = (known.of(optics, dz, 5e-3).optics for dz in (-5 * mm, -4 * mm, 6 * mm))
    assert near.axes == far.axes  # the cells are those of the most blurred
    assert near.beside == middle.beside < far.beside
    assert known.of(optics, -5 * mm, 5e-3)._pieces is known.of(optics, -4 * mm, 5e-3)._pieces
    for dz in (-4 * mm, 6 * mm):
        point = Points(np.column_stack([places, [dz]]), np.ones(1))
        alone = points_image(camera, point, 1e-2, RelaySet(optics.object_distance + 6 * mm))
        np.testing.assert_array_equal(points_image(camera, point, 1e-2, known), alone)
