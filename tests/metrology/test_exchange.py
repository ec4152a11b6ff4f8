"""Cameras in files of COMPOTE and LFToolbox mean the same rays there as here."""

import json
from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real
from lumigraph.errors import FormatError
from lumigraph.metrology.boards import compote, geometry

RNG = np.random.default_rng(18)
SHAPE = (600, 801)
CAMERA = lg.metrology.MetricCamera(
    50e-3,
    56e-3,
    0.4e-3,
    52e-3,
    5e-6,
    (310.0, 395.0),
    (6e-4, -9e-4),
    (0.3, -2.0, 5.0),
    (2e-3, -3e-3),
    (1.0,) * 3,
)
HEX = lg.Lattice(((0.02, 23.0), (19.95, 11.51)), (3.1, 4.2), "hex", 3)
SQUARE = lg.Lattice(((0.05, 24.0), (24.2, -0.03)), (7.5, 5.25))


def calibration(lattice):
    indices = lattice.indices((0, SHAPE[0] - 1), (0, SHAPE[1] - 1))
    return lg.Calibration(lattice, SHAPE, indices, lattice.position(indices), 0.0)


def seen_by_compote(found, points, k, row):
    """Places (u, v) of points (n, 3) as (x, y, z) [mm], by pin holes, micro-image (k, row) of each.

    By the model's geometry alone: image by the thin lens, Brown's polynomial in millimetres there, then a
    straight line through the lenslet's middle to the sensor.
    """
    f, mesh = float(found["main_lens"]["f"]), found["mla"]["mesh"]
    spot = points * (f / (f - points[:, 2:]))
    x, y, _ = spot.T
    r2 = x**2 + y**2
    radial, tangential = (np.array(found["distortions"][name], float)[0] for name in ("radial", "tangential"))
    grown = radial[0] * r2 + radial[1] * r2**2 + radial[2] * r2**3
    spot[:, 0] += x * grown + tangential[0] * (r2 + 2 * x * x) + 2 * tangential[1] * x * y
    spot[:, 1] += y * grown + tangential[1] * (r2 + 2 * y * y) + 2 * tangential[0] * x * y
    across, down = np.array(mesh["pitch"], float)[0]
    k, row = int(mesh["width"]) - 1 - k, int(mesh["height"]) - 1 - row
    flat = np.stack([across * (k + 0.5 * (row % 2 == 0)), down * row * np.sin(np.pi / 3), 0 * k], axis=1)
    turn = np.array(mesh["pose"]["rotation"], float)  # its rows are the turned axes
    lens = flat @ turn + np.array(mesh["pose"]["translation"], float)
    sensor, pixel = found["sensor"], float(found["sensor"]["scale"])
    at = np.array(sensor["pose"]["translation"], float)[0]
    hit = lens + (at[2] - lens[:, 2:]) / (spot[:, 2:] - lens[:, 2:]) * (spot - lens)
    last = np.array([int(sensor["width"]), int(sensor["height"])]) - 1
    return last - (hit - at)[:, :2] / pixel


def centers_of_compote(found, k, row):
    """Micro-images' centres (u, v)."""
    mesh = found["mia"]["mesh"]
    across, down = np.array(mesh["pitch"], float)[0]
    flat = np.stack([across * (k + 0.5 * (row % 2 == 0)), down * row * np.sin(np.pi / 3)], axis=1)
    return flat @ np.array(mesh["pose"]["rotation"], float) + np.array(mesh["pose"]["translation"], float)


def off_compote(camera, found, distance):
    """Largest way between both cameras' places of points so far away, all over the picture [px]."""
    rows, columns = int(found["sensor"]["height"]), int(found["sensor"]["width"])
    mesh = found["mia"]["mesh"]
    k = RNG.integers(0, int(mesh["width"]) - 1, 400)
    row = RNG.integers(0, int(mesh["height"]) - 1, 400)
    center = centers_of_compote(found, k, row)[:, ::-1]
    half = np.array([rows, columns]) / 2 * camera.pixel_pitch / camera.separation
    n = (center - camera.axis) * camera.pixel_pitch / camera.separation + 0.03 * half * RNG.uniform(
        -1, 1, (400, 2)
    )
    points = np.column_stack([np.full(400, distance), n * distance])
    theirs = seen_by_compote(found, points[:, ::-1] * 1e3, k, row)[:, ::-1]
    return float(np.abs(camera.project(points, center) - theirs).max())


def test_compote_sees_points_where_the_camera_does():
    # A sign, an axis or a power of the image distance that is wrong moves places by 0.01 px and more.
    camera = replace(CAMERA, tilt=(0.0, 0.0))
    found, _ = compote.intrinsics_of(camera, calibration(HEX), distance=0.4)
    assert off_compote(camera, found, 0.4) < 1e-4
    assert off_compote(replace(camera, tangential=(-2e-3, 3e-3)), found, 0.4) > 0.05
    assert off_compote(camera, found, 0.6) > 1e-3  # its distortion changes with the distance
    # Of a tilted array lenslets are regular there, and micro-images here: c² tilt / E on the sensor, 0.03 px.
    found, notes = compote.intrinsics_of(CAMERA, calibration(HEX), distance=0.4)
    assert 1e-3 < off_compote(CAMERA, found, 0.4) < 0.03
    assert any("tilted array are not regular: up to 0.0" in note for note in notes)


def lenslets_of_compote(found):
    """Where lenslets are (n, 3) as (x, y, z) [mm]."""
    mesh = found["mla"]["mesh"]
    across, down = np.array(mesh["pitch"], float)[0]
    row, k = (one.ravel() for one in np.indices((int(mesh["height"]), int(mesh["width"]))))
    flat = np.stack([across * (k + 0.5 * (row % 2 == 0)), down * row * np.sin(np.pi / 3), 0 * k], axis=1)
    return flat @ np.array(mesh["pose"]["rotation"], float) + np.array(mesh["pose"]["translation"], float)


@pytest.mark.parametrize("real_one", [False, True])
def test_compotes_array_leans_as_the_cameras(real_one):
    camera, found = CAMERA, compote.intrinsics_of(CAMERA, calibration(HEX), distance=0.4)[0]
    if real_one:
        path = real("compote_r12a", "intrinsics.json")
        camera, found = lg.metrology.load_camera(path)[0], json.loads(path.read_text())
    x, y, z = lenslets_of_compote(found).T
    away = camera.separation * 1e3 + np.stack([-y, -x], 1) @ camera.tilt  # its axes run against the picture's
    assert np.allclose(-z, away, atol=1e-9)
    assert np.ptp(z) > 1e-4


def test_compotes_lenslets_shine_onto_their_micro_images():
    camera = replace(CAMERA, tilt=(0.0, 0.0))
    found, _ = compote.intrinsics_of(camera, calibration(HEX), distance=0.4)
    lens = lenslets_of_compote(found)[::-1, :2]  # in the order of the micro-images
    mesh = found["mia"]["mesh"]
    row, k = (one.ravel() for one in np.indices((mesh["height"], mesh["width"])))
    center = centers_of_compote(found, k, row) - np.array(camera.axis[::-1])
    reach = camera.exit_pupil / (camera.exit_pupil + camera.lenslet_distance)
    assert np.allclose(-lens, center * camera.pixel_pitch * 1e3 * reach, atol=1e-9)


def test_the_real_camera_of_compote_is_read_as_it_sees():
    path = real("compote_r12a", "intrinsics.json")
    camera, found = lg.metrology.load_camera(path)
    assert camera.focal_length == pytest.approx(49.885285868753407e-3)
    assert (found.lattice.layout, found.lattice.kinds, found.shape) == ("hex", 3, (3068, 4080))
    assert off_compote(camera, json.loads(path.read_text()), 0.45) < 0.5  # the array's tilt, at the corners
    assert any("tilted array are not regular: up to 0.3" in note for note in found.notes)


def test_compotes_micro_images_are_of_the_kind_that_its_observations_say():
    _, found = lg.metrology.load_camera(real("compote_r12a", "intrinsics.json"))
    seen, _, _ = lg.metrology.load_compote(real("compote_r12a", "bap.csv").parent)
    index = found.index(*seen.center.T)
    assert np.abs(found.position(np.stack(index, -1)) - seen.center).max() < 0.5
    assert np.array_equal(found.lattice.kind(*index), seen.kind)


@pytest.mark.parametrize("lattice", [HEX, SQUARE], ids=["hex", "square"])
def test_a_camera_comes_back_from_compote(tmp_path, lattice):
    straight = replace(lattice, basis=compote_basis(lattice))
    camera = replace(CAMERA, gains=(1.0,) * lattice.kinds)
    lg.metrology.save_camera(
        camera, calibration(straight), tmp_path / "a.json", "compote", distance=0.4, f_number=4.0
    )
    again, found = lg.metrology.load_camera(tmp_path / "a.json")
    assert np.allclose(again.numbers, camera.numbers, rtol=1e-9, atol=1e-12)
    assert (found.shape, found.lattice.layout, found.lattice.kinds) == (SHAPE, lattice.layout, lattice.kinds)
    centers = straight.centers((0, 599), (0, 800))
    assert np.allclose(found.lattice.centers((0, 599), (0, 800)), centers, atol=1e-9)
    kinds = found.lattice.kind(*found.lattice.index(*centers.T))
    assert np.array_equal(kinds, straight.kind(*straight.index(*centers.T)))


def compote_basis(lattice):
    """With rows that do not slip: a mesh has two pitches and a rotation."""
    row, column = (np.array(vector) for vector in lattice.basis)
    normal = np.array([row[1], -row[0]]) / np.hypot(*row)
    column = normal * (column @ normal) + (row / 2 if lattice.layout == "hex" else 0)
    return tuple(row.tolist()), tuple(column.tolist())


def test_what_compote_cannot_hold_is_named(tmp_path):
    odd = replace(CAMERA, gains=(0.99, 1.0, 1.01))
    notes = lg.metrology.save_camera(odd, calibration(HEX), tmp_path / "a.json", "compote", distance=0.4)
    told = " / ".join(notes)
    for word in ("uncertainties", "focal lengths", "dist_focus", "f-number", "gains", "sheared by"):
        assert word in told
    near = replace(CAMERA, separation=49e-3, exit_pupil=45e-3)
    with pytest.raises(
        FormatError, match="no plane has its image in the lenslets, 49 mm from a lens of 50 mm"
    ):
        lg.metrology.save_camera(near, calibration(HEX), tmp_path / "a.json", "compote")


def test_cameras_that_compote_cannot_mean_are_refused(tmp_path):
    path = tmp_path / "a.json"
    with pytest.raises(FormatError, match="distance is 50 mm but must be beyond f, 50 mm"):
        lg.metrology.save_camera(CAMERA, calibration(HEX), path, "compote", distance=0.05)
    lg.metrology.save_camera(CAMERA, calibration(HEX), path, "compote", distance=0.4)
    found = json.loads(path.read_text())
    found["mla"]["mesh"]["pitch"] = [[p * CAMERA.pixel_pitch * 1e3 for p in found["mia"]["mesh"]["pitch"][0]]]
    path.write_text(json.dumps(found))
    with pytest.raises(FormatError, match=r"mia.mesh.pitch is 1 of mla.mesh.pitch but must be more"):
        lg.metrology.load_camera(path)


FLAT = replace(CAMERA, tilt=(0.0, 0.0), radial=(0.0,) * 3, tangential=(0.0, 0.0), gains=(1.0,))


def rays_of(found, index):
    """Rays (n, 5) as (s, t, u, v, 1) of samples (n, 4) as (i, j, k, l)."""
    return np.column_stack([index, np.ones(len(index))]) @ np.array(found["EstCamIntrinsicsH"]).T


def test_rays_of_lftoolbox_are_those_of_the_camera(tmp_path):
    square = calibration(SQUARE)
    lg.metrology.save_camera(FLAT, square, tmp_path / "a.json", "lftoolbox", directions=9)
    found = json.loads((tmp_path / "a.json").read_text())
    index = RNG.integers(1, 10, (200, 4)) + np.array([0, 0, 6, 3])
    first = square.indices.min(0)
    center = SQUARE.position(index[:, :1:-1] - 1 + first)
    way = (
        (index[:, :2] - 5) / 9 @ np.array(SQUARE.basis)
    )  # views along the lattice's own axes, from the middle
    ray = rays_of(found, index)
    for away in (0.2, 0.5, 3.0):
        points = np.column_stack([np.full(200, away), (ray[:, :2] + away * ray[:, 2:4])[:, ::-1]])
        assert np.allclose(FLAT.project(points, center), center + way, atol=1e-7)


def test_distortion_of_lftoolbox_turns_rays_to_where_points_are(tmp_path):
    camera = replace(FLAT, radial=(0.3, -2.0, 5.0), tangential=(2e-3, -3e-3))
    lg.metrology.save_camera(camera, calibration(SQUARE), tmp_path / "a.json", "lftoolbox", directions=9)
    k1, k2, k3, *middle = json.loads((tmp_path / "a.json").read_text())["EstCamDistortionV"]
    seen = RNG.uniform(-0.04, 0.04, (50, 2))
    from_middle = seen - middle
    r2 = (from_middle**2).sum(1, keepdims=True)
    true = from_middle * (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) + middle
    for sign, most in ((1, 1e-5), (-1, np.inf)):  # the distortion's middle is held to first order
        tangential = sign * np.array(camera.tangential)
        back = geometry.distorted(true[:, ::-1], np.array(camera.radial), tangential)
        assert np.abs(back[:, ::-1] - seen).max() < most
    assert np.abs(back[:, ::-1] - seen).max() > 3e-5
    assert np.abs(true - seen).max() > 2e-5


def test_a_camera_comes_back_from_lftoolbox(tmp_path):
    camera = replace(FLAT, radial=(0.3, -2.0, 5.0), tangential=(2e-3, -3e-3))
    straight = replace(SQUARE, basis=compote_basis(SQUARE))
    notes = lg.metrology.save_camera(
        camera, calibration(straight), tmp_path / "a.json", "lftoolbox", directions=9
    )
    again, found = lg.metrology.load_camera(tmp_path / "a.json")
    assert np.allclose(again.numbers, camera.numbers, rtol=1e-9, atol=1e-10)
    assert found.shape == SHAPE
    assert np.allclose(
        found.lattice.centers((0, 599), (0, 800)), straight.centers((0, 599), (0, 800)), atol=1e-9
    )
    assert not any("tilt" in note for note in notes)


def test_what_lftoolbox_cannot_hold_is_named(tmp_path):
    path = tmp_path / "a.json"
    odd = replace(CAMERA, radial=(0.0, 0.0, 0.0))
    notes = lg.metrology.save_camera(odd, calibration(SQUARE), path, "lftoolbox", directions=9)
    told = " / ".join(notes)
    for word in ("uncertainties", "tangential", "tilt (0.6, -0.9 mrad)", "3 kinds", "shear"):
        assert word in told
    with pytest.raises(FormatError, match="the lattice is hex but"):
        lg.metrology.save_camera(CAMERA, calibration(HEX), path, "lftoolbox", directions=9)
    with pytest.raises(FormatError, match="Give directions=9"):
        lg.metrology.save_camera(FLAT, calibration(SQUARE), path, "lftoolbox")
    with pytest.raises(FormatError, match="form is 'ini' but must be one of compote, lftoolbox"):
        lg.metrology.save_camera(FLAT, calibration(SQUARE), path, "ini")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("EstCamIntrinsicsH", np.zeros((5, 5)).tolist(), "moves s and t by nothing"),
        ("EstCamIntrinsicsH", np.diag([1.0, 1.0, -1.0, -1.0, 1.0]).tolist(), "which no camera has"),
        ("EstCamIntrinsicsH", [[1.0]], "has shape (1, 1) but must be (5, 5)"),
        ("LFMetadata", {}, "does not say how wide pixels are"),
        ("CalOptions", {}, "KeyError 'LFSize'"),
    ],
)
def test_damaged_files_of_lftoolbox_are_named(tmp_path, key, value, message):
    path = tmp_path / "a.json"
    lg.metrology.save_camera(FLAT, calibration(SQUARE), path, "lftoolbox", directions=9)
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(FormatError) as raised:
        lg.metrology.load_camera(path)
    assert message in str(raised.value)


def test_another_json_file_is_refused(tmp_path):
    (tmp_path / "a.json").write_text('{"b": 1}')
    with pytest.raises(
        FormatError, match=r"neither COMPOTE's intrinsics nor LFToolbox' CalInfo: it has the keys b"
    ):
        lg.metrology.load_camera(tmp_path / "a.json")
