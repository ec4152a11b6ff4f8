"""Meshes of depth maps: faces that face the camera, cut where depth jumps, as another program reads them."""

import numpy as np
import pytest
import trimesh

import lumigraph as lg
from lumigraph import depth
from lumigraph.errors import FormatError, GeometryError

SHAPE, FAR, NEAR, LENGTH = (30, 40), 0.50, 0.40, 0.1


def views_of(shape=SHAPE):
    return lg.LightField(np.zeros((3, 3, *shape)), lg.Grid((3, 3), 1e-3), lg.Grid(shape, 1e-4), LENGTH)


def mesh_of(distance, error=1e-4, trust=None):
    trust = np.ones(distance.shape) if trust is None else trust
    found = depth.DepthMap(distance - FAR, trust, "depth", np.full(distance.shape, error))
    paint = np.random.default_rng(1).integers(0, 255, (*distance.shape, 3), np.uint8)
    return depth.cloud(found, views_of(), object_distance=FAR, colours=paint, faces=True)


@pytest.fixture(scope="module")
def card():
    """A card 0.4 m away before a wall at 0.5 m."""
    distance = np.full(SHAPE, FAR)
    distance[8:20, 10:25] = NEAR
    return mesh_of(distance)


def test_a_mesh_opens_elsewhere_with_its_colours_and_its_area(card, tmp_path):
    lg.save(card, tmp_path / "mesh.ply")
    other = trimesh.load_mesh(tmp_path / "mesh.ply", process=False)
    np.testing.assert_allclose(other.vertices, np.asarray(card.points)[:, ::-1], rtol=1e-6)
    np.testing.assert_array_equal(other.visual.vertex_colors[:, :3], card.colours)
    side = 1e-4 / LENGTH  # [rad] from one place to the next
    wall = (29 * 39 - 13 * 16) * (side * FAR) ** 2  # without the squares that touch the card or its edge
    assert other.area == pytest.approx(wall + 11 * 14 * (side * NEAR) ** 2, rel=1e-3)


def test_faces_are_cut_where_depth_jumps(card, tmp_path):
    lg.save(card, tmp_path / "mesh.ply")
    other = trimesh.load_mesh(tmp_path / "mesh.ply", process=False)
    depths = other.vertices[other.faces][..., 2]
    assert np.ptp(depths, axis=1).max() < 1e-6  # no face leads from the card to the wall
    assert sorted(set(depths.ravel().round(3))) == pytest.approx([NEAR, FAR])


def test_faces_turn_to_the_camera(card):
    points, faces = np.asarray(card.points)[:, ::-1], np.asarray(card.faces)
    a, b, c = (points[faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()


@pytest.mark.parametrize("slope", [0.0, 2e-3, 2e-2])
def test_slanted_and_noisy_surfaces_stay_whole(slope):
    """Of 20 mm a place, as steep as 89 degrees; noise as large as the expected error."""
    rng = np.random.default_rng(2)
    distance = FAR + slope * np.arange(SHAPE[1]) + 1e-3 * rng.standard_normal(SHAPE)
    mesh = mesh_of(distance, error=1e-3)
    assert mesh.faces is not None
    assert len(mesh.faces) > 0.995 * 2 * 29 * 39


def test_unsure_places_leave_holes():
    trust = np.ones(SHAPE)
    trust[5, 5] = trust[12, 20] = 0.1
    mesh = mesh_of(np.full(SHAPE, FAR), trust=trust)
    assert mesh.faces is not None
    assert len(mesh) == 30 * 40 - 2
    assert (
        len(mesh.faces) == 2 * 29 * 39 - 2 * 8 + 2 * 2
    )  # of the four squares around, two corners stay whole


def test_a_mesh_survives(card, tmp_path):
    lg.save(card, tmp_path / "mesh.ply")
    back = lg.open(tmp_path / "mesh.ply", lg.PointCloud)
    np.testing.assert_array_equal(back.faces, card.faces)
    content = (tmp_path / "mesh.ply").read_bytes()
    (tmp_path / "short.ply").write_bytes(content[:-5])
    with pytest.raises(FormatError, match="faces are there"):
        lg.open(tmp_path / "short.ply")


def test_meshes_by_others_are_read_and_polygons_are_left(tmp_path):
    box = trimesh.creation.box()
    box.export(tmp_path / "box.ply")
    back = lg.open(tmp_path / "box.ply", lg.PointCloud)
    np.testing.assert_array_equal(back.faces, box.faces)
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\n"
    head += b"".join(b"property float %c\n" % name for name in b"xyz")
    head += b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    quad = bytes([4]) + np.arange(4, dtype="<i4").tobytes()
    (tmp_path / "quad.ply").write_bytes(head + np.zeros((4, 3), "<f4").tobytes() + quad)
    assert lg.open(tmp_path / "quad.ply", lg.PointCloud).faces is None


def test_a_cloud_has_no_faces_unless_asked_for(tmp_path):
    found = depth.DepthMap(np.zeros(SHAPE), np.ones(SHAPE), "depth")
    cloud = depth.cloud(found, views_of(), object_distance=FAR)
    assert cloud.faces is None
    lg.save(cloud, tmp_path / "points.ply")
    assert trimesh.load(tmp_path / "points.ply").vertices.shape == (SHAPE[0] * SHAPE[1], 3)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (np.array([[0, 1, 3]]), "faces name points 0 to 3 but there are 3"),
        (np.array([[-1, 1, 2]]), "faces name points -1"),
        (np.zeros((2, 4), int), r"must be integers \(m, 3\)"),
        (np.zeros((2, 3)), r"must be integers \(m, 3\)"),
    ],
)
def test_faces_that_cannot_be(faces, message):
    with pytest.raises(GeometryError, match=message):
        lg.PointCloud(np.ones((3, 3)), faces=faces)
