"""`lumigraph depth`."""

import json

import numpy as np
import pytest

import lumigraph as lg

SHAPE = (40, 44)
NEAR = 0.5  # disparity of the scene


@pytest.fixture
def views(tmp_path):
    """Views of a textured plane nearer than the plane in focus."""
    v, u, y, x = np.meshgrid(*(np.arange(n) - n // 2 for n in (5, 5, *SHAPE)), indexing="ij")
    rng = np.random.default_rng(5)
    ky, kx, phase = [*rng.uniform(-0.8, 0.8, (2, 30)).tolist(), rng.uniform(0, 6, 30).tolist()]
    data = np.full(v.shape, 8.0)
    for a, b, c in zip(ky, kx, phase, strict=True):
        data += np.cos(a * (y - NEAR * v) + b * (x - NEAR * u) + c)
    field = lg.LightField(data, lg.Grid((5, 5), 1e-3), lg.Grid(SHAPE, 1e-4), 0.24)
    lg.save(field, tmp_path / "views.zarr")
    return field


def test_disparities_are_written_with_their_confidence(lumigraph, views, tmp_path):
    found = lumigraph("depth", "views.zarr", "-o", "map.pfm", "--confidence", "trust.tiff", "--json")
    assert found.code == 0, found.err
    told = json.loads(found.out)
    assert (told["quantity"], told["unit"], tuple(told["shape"])) == ("disparity", "px", SHAPE)
    assert told["median"] == pytest.approx(NEAR, abs=0.005)
    assert np.median(lg.open(tmp_path / "map.pfm").data) == pytest.approx(NEAR, abs=0.005)
    assert lg.open(tmp_path / "trust.tiff").shape == SHAPE


def test_a_zarr_store_holds_the_whole_map(lumigraph, views, tmp_path):
    found = lumigraph("depth", "views.zarr", "-o", "map.zarr", "--focal-length", "120 mm", "--json")
    assert found.code == 0, found.err
    whole, told = lg.open(tmp_path / "map.zarr", lg.DepthMap), json.loads(found.out)
    assert (whole.quantity, whole.unit) == ("depth", "m")
    assert whole.usual_error == pytest.approx(told["expected_error"], rel=1e-3)
    assert np.median(whole.confidence) > 0.5


def test_lengths_make_metres_and_points(lumigraph, views, tmp_path):
    found = lumigraph("depth", "views.zarr", "-o", "points.ply", "--focal-length", "120 mm")
    assert found.code == 0, found.err
    assert found.out.startswith("depth of 40 x 44 places: -11.")
    points = lg.open(tmp_path / "points.ply")
    # 0.5 lenslets of 0.1 mm per view of 1 mm: α' = 0.95, the image at 240/0.95 mm.
    expected = 1 / (1 / 0.12 - 0.95 / 0.24)
    assert np.median(np.asarray(points.points)[:, 0]) == pytest.approx(expected, rel=2e-3)
    assert len(points) > 0.9 * SHAPE[0] * SHAPE[1]


@pytest.mark.parametrize("method", ["focus", "fused"])
def test_other_methods_agree(lumigraph, views, method):
    found = lumigraph("depth", "views.zarr", "--method", method, "-o", "map.png", "--json")
    assert found.code == 0, found.err
    told = json.loads(found.out)
    median = told["median"] if method == "fused" else (1 - told["median"]) * 10
    assert median == pytest.approx(NEAR, abs=0.05)


def test_the_focal_stack_of_fused_suits_views_far_apart(lumigraph, views, tmp_path):
    near = lg.open(tmp_path / "views.zarr")
    lenslets = lg.Grid(near.lenslets.shape, near.lenslets.pitch[0] / 10)  # 100 px per view for α' = 0
    lg.save(lg.LightField(near.data, near.aperture, lenslets, near.separation), tmp_path / "far.zarr")

    def error(*words):
        assert lumigraph("depth", "far.zarr", "--method", "fused", "-o", "map.pfm", *words).code == 0
        return float(np.abs(lg.open(tmp_path / "map.pfm").data - NEAR).mean())

    suited = error()
    assert suited < 0.006
    assert error("--alphas", "0.9:1.1:x21") > 1.1 * suited  # planes a pixel per view apart


@pytest.mark.parametrize(("method", "shape"), [("correlation", (8, 9)), ("dense", (31, 35))])
def test_patches_of_a_raw_image(lumigraph, tmp_path, method, shape):
    lattice = lg.Lattice.square(12.0, origin=(6, 6))
    y, x = np.meshgrid(*map(np.arange, (96, 108)), indexing="ij")
    dy, dx = lattice.offset(y, x)
    place = y - dy - dy * 12 / 4.0, x - dx - dx * 12 / 4.0
    raw = 2 + np.sin(0.3 * place[0] + 0.15 * place[1]) + np.cos(0.28 * place[1] - 0.1 * place[0])
    none = np.zeros((0, 2))
    lg.save(lg.RawImage(raw.astype(np.float32)), tmp_path / "raw.tiff")
    lg.save(lg.Calibration(lattice, raw.shape, none.astype(int), none, 0.0), tmp_path / "camera.toml")
    words = ("depth", "raw.tiff", "--calibration", "camera.toml", "--method", method, "-o", "map.tiff")
    found = lumigraph(*words, "--range", "2:6", "--smooth", 1, "--json")
    assert found.code == 0, found.err
    assert json.loads(found.out)["median"] == pytest.approx(4.0, abs=0.1)
    assert tuple(json.loads(found.out)["shape"]) == shape


@pytest.mark.parametrize("which", ["star", "cross", "row"])
def test_views_are_chosen_by_name(lumigraph, views, tmp_path, which):
    found = lumigraph("depth", "views.zarr", "--views", which, "-o", "map.pfm")
    assert found.code == 0, found.err
    some = lg.rendering.arranged(views, which)
    assert np.asarray(some.data != 0).any((2, 3)).sum() == {"star": 17, "cross": 9, "row": 5}[which]
    np.testing.assert_allclose(lg.open(tmp_path / "map.pfm").data, lg.depth.epi(some).values, atol=1e-5)
    assert np.median(lg.open(tmp_path / "map.pfm").data) == pytest.approx(NEAR, abs=0.01)


def test_wrong_words_are_told_in_one_line(lumigraph, views):
    for words, told in (
        (("-o", "map.obj"), "wrong extension"),
        (("-o", "map.ply"), "points need the camera's lengths"),
        (("-o", "map.tiff", "--range", "1"), "must be least:most, such as -2:3"),
        (("-o", "map.tiff", "--range", "2:1"), "the first must be less"),
        (("-o", "map.tiff", "--method", "correlation"), "is for raw images of cameras 2.0"),
        (("-o", "map.tiff", "--white", "white.png"), "holds views, which need no --calibration"),
        (("-o", "map.tiff", "--correct"), "--correct simulates a camera"),
        (("-o", "map.tiff", "--focal-length", "0 mm"), "must be a finite number above 0"),
    ):
        found = lumigraph("depth", "views.zarr", *words)
        assert found.code != 0
        assert told in found.err
        assert found.err.count("\n") == 1


@pytest.mark.long  # a minute of wave optics
@pytest.mark.parametrize("dz", [-0.03, 0.03])
def test_the_bias_of_diffraction_is_corrected(lumigraph, tmp_path, dz):
    camera = lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    lenslets = {**camera.lenslets.model_dump(exclude_unset=True), "count": (25, 25)}
    camera = camera.replace(lenslets=lenslets)
    grid, rng = camera.object_grid, np.random.default_rng(3)
    ky, kx = rng.uniform(-4e3, 4e3, (2, 40, 1, 1))
    waves = np.cos(ky * grid.y[:, None] + kx * grid.x + rng.uniform(0, 6, (40, 1, 1))).sum(0)
    scene = lg.Scene((lg.Slice(np.maximum(1 + 0.15 * waves, 0), grid, dz),))
    lg.save(lg.simulate(camera, scene), tmp_path / "raw.tiff")
    lg.save(camera.calibration, tmp_path / "camera.toml")
    words = (
        "depth",
        "raw.tiff",
        "--calibration",
        "camera.toml",
        "--camera",
        "thesis-plenoptic-1",
        "-o",
        "z.tiff",
    )
    plain, corrected = (lumigraph(*words, "--json", *more) for more in ((), ("--correct",)))
    assert corrected.code == 0, corrected.err
    off = [abs(json.loads(found.out)["median"] - dz) for found in (plain, corrected)]
    assert off[0] > 4e-3
    assert off[1] < 2.5e-3
