"""Pictures with depths as opaque slices."""

from types import SimpleNamespace

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.scene import targets

CAMERA = SimpleNamespace(object_distance=0.1, pupil_diameter=4e-3)
GRID = Grid.square(60, 1e-4)


def scene(**changed):
    rng = np.random.default_rng(1)
    depth = np.full(GRID.shape, 0.02)
    depth[20:40, 15:45] = -0.01
    depth[30:50, 40:55] = 0.0
    given = {"picture": rng.uniform(0.1, 1, (*GRID.shape, 3)), "depth": depth, "planes": 8} | changed
    return given, targets.rgbd(given["picture"], given["depth"], GRID, CAMERA, given["planes"],
                               behind=given.get("behind"))  # fmt: skip


def seen_from(parts, u, v=0.0):
    """Colours (y, x) in the focused plane, from a place of the main lens: of the nearest opaque slice."""
    y, x = np.meshgrid(GRID.y, GRID.x, indexing="ij")
    found, near = np.full((*GRID.shape, 3), -1.0), np.full(GRID.shape, np.inf)
    for part in parts:
        z = CAMERA.object_distance + part.dz
        share = part.dz / CAMERA.object_distance
        i = np.rint((y * (1 + share) - v * share - part.grid.y[0]) / part.grid.pitch[0]).astype(int)
        j = np.rint((x * (1 + share) - u * share - part.grid.x[0]) / part.grid.pitch[1]).astype(int)
        inside = (i >= 0) & (i < GRID.shape[0]) & (j >= 0) & (j < GRID.shape[1])
        i, j = i.clip(0, GRID.shape[0] - 1), j.clip(0, GRID.shape[1] - 1)
        mine = inside & (part.opacity[i, j] > 0) & (z < near)
        found[mine], near[mine] = part.intensity[i, j][mine], z
    return found


def test_the_middle_of_the_lens_sees_the_picture():
    given, made = scene()
    np.testing.assert_allclose(seen_from(made.parts, 0.0), given["picture"], rtol=1e-6)


def test_depths_are_those_of_the_slices_to_half_a_step():
    given, made = scene()
    steps = np.ptp(1 / (0.1 + given["depth"])) / 7
    for part in made.parts:
        inverse = 1 / (0.1 + given["depth"][part.opacity > 0])
        assert abs(1 / (0.1 + part.dz) - inverse).min() <= steps / 2
    assert [round(part.dz, 3) for part in made.parts] == [0.02, 0.001, -0.01]


@pytest.mark.parametrize(("u", "v"), [(2e-3, 0.0), (-2e-3, 0.0), (0.0, 2e-3), (1.4e-3, -1.4e-3)])
def test_the_border_of_the_lens_sees_no_hole(u, v):
    _, made = scene()
    inner = seen_from(made.parts, u, v)[8:-8, 8:-8]
    assert (inner >= 0).all()


def test_slices_end_behind_what_hides_them():
    """Deep behind a near one nothing is seen, and nothing must hide what is farther and seen from aside."""
    _, made = scene()
    assert not made.parts[0].opacity[28:32, 25:35].any()


def test_what_goes_on_may_be_given():
    given, made = scene(behind=np.full((*GRID.shape, 3), 7.0))
    far = made.parts[0]
    beneath = (far.opacity > 0) & (given["depth"] != 0.02)
    assert beneath.any()
    assert (far.intensity[beneath] == 7).all()
    np.testing.assert_allclose(seen_from(made.parts, 0.0), given["picture"], rtol=1e-6)


def test_a_flat_picture_is_one_slice():
    _, made = scene(depth=np.full(GRID.shape, 5e-3))
    (part,) = made.parts
    assert part.dz == pytest.approx(5e-3)
    assert part.opacity.all()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"depth": np.zeros((3, 3))}, r"depth has shape \(3, 3\)"),
        ({"depth": np.full(GRID.shape, -0.2)}, "main lens stands at -100 mm"),
        ({"depth": np.full(GRID.shape, np.nan)}, "NaN"),
        ({"planes": 65}, "at most 64"),
        ({"planes": 0}, "planes"),
        ({"behind": np.zeros(GRID.shape)}, "behind has shape"),
    ],
)
def test_impossible_pictures_are_refused(changed, message):
    with pytest.raises(GeometryError, match=message):
        scene(**changed)
