"""`lumigraph deconvolve`."""

import functools
import importlib
import json

import numpy as np
import pytest
import tifffile
from scipy.ndimage import gaussian_filter

import lumigraph as lg
from lumigraph.cli.frames import Frames, items_of
from lumigraph.cli.options import planes
from lumigraph.operators.microscope.volume_operator import MicroscopeOperator
from lumigraph.preparation import vignetting

FOCUSED = """
kind = "focused-plenoptic"
wavelength = "550 nm"
object_distance = "100 mm"
[main_lens]
focal_length = "50 mm"
[lenslets]
pitch = "80 um"
focal_length = "2.4 mm"
count = [3, 3]
magnification = 0.5
[sensor]
pixel_pitch = "5 um"
"""
SCOPE = """
kind = "light-field-microscope"
wavelength = "550 nm"
[objective]
magnification = 20
numerical_aperture = 0.4
[lenslets]
pitch = "100 um"
focal_length = "2 mm"
count = [5, 5]
[sensor]
pixel_pitch = "12.5 um"
"""
LENS = """
kind = "single-lens"
wavelength = "550 nm"
object_distance = "100 mm"
[main_lens]
focal_length = "50 mm"
diameter = "3 mm"
[sensor]
pixel_pitch = "4 um"
shape = [40, 50]
"""


@pytest.fixture
def focused(lumigraph, tmp_path):
    """A camera file and a noisy raw image of it."""
    (tmp_path / "camera.toml").write_text(FOCUSED)
    found = lumigraph("simulate", "camera.toml", "--scene", "siemens_star", "--noise", "-o", "raw.tiff")
    assert found.code == 0, found.err
    return lumigraph


def test_a_focused_camera_gives_its_picture_and_a_report(focused, tmp_path):
    found = focused(
        "deconvolve", "raw.tiff", "--camera", "camera.toml", "--iterations", 3, "-o", "picture.tiff",
        "--report", "page.html", "--prior", "tv", "--strength", 0.01, "--accelerated", "--json",
    )  # fmt: skip
    assert found.code == 0, found.err
    values = json.loads(found.out)
    picture = lg.open(tmp_path / "picture.tiff")
    camera = lg.FocusedPlenopticCamera.from_toml(tmp_path / "camera.toml")
    assert values["iterations"] == 3
    assert values["pixel_pitch"] == pytest.approx(camera.operator().object_grid.pitch[0])
    assert picture.shape == tuple(values["shape"])
    assert picture.pixel_pitch == pytest.approx(camera.operator().object_grid.pitch[0])
    assert float(picture.data.min()) >= 0
    page = (tmp_path / "page.html").read_text()
    assert "deviance" in page
    assert page.count("<img") == 3


def test_a_run_goes_on_from_its_checkpoint(focused, tmp_path):
    said = ("deconvolve", "raw.tiff", "--camera", "camera.toml", "--checkpoint", "state.npz")
    assert focused(*said, "--iterations", 2, "-o", "two.tiff").code == 0
    assert focused(*said, "--iterations", 3, "-o", "three.tiff").code == 0
    found = focused(*said[:-2], "--iterations", 3, "-o", "whole.tiff")
    assert "3 iterations, deviance" in found.out
    three, whole = (lg.open(tmp_path / f"{name}.tiff").data for name in ("three", "whole"))
    np.testing.assert_array_equal(three, whole)
    assert "finished already" in focused(*said, "--iterations", 3, "-o", "again.tiff").out


def test_ctrl_c_keeps_what_was_reached(focused, tmp_path, monkeypatch):
    from lumigraph import deconvolution

    real = deconvolution.Deconvolver.__call__

    def interrupted(*arguments, progress, **options):
        def stop(step):
            if step.iteration == 2:
                raise KeyboardInterrupt

        return real(*arguments, progress=stop, **options)

    monkeypatch.setattr(deconvolution.Deconvolver, "__call__", interrupted)
    found = focused("deconvolve", "raw.tiff", "--camera", "camera.toml", "-o", "picture.tiff")
    assert found.code == 130
    assert "2 iterations are in picture.partial.tiff" in found.err
    assert not (tmp_path / "picture.tiff").exists()
    assert float(lg.open(tmp_path / "picture.partial.tiff").data.max()) > 0


def test_it_stops_where_an_iteration_changes_little(focused):
    said = ("deconvolve", "raw.tiff", "--camera", "camera.toml", "--change", 0.2, "--json", "-o", "out.tiff")
    found = json.loads(focused(*said).out)
    assert 1 < found["iterations"] < 30
    assert found["change"] < 0.2
    assert found["stopped"] == f"change {found['change']:.3g} is below 0.2"


def test_pages_of_a_series_share_one_sensitivity(focused, tmp_path, monkeypatch):
    """It was computed again for each page, and the object widened again."""
    module = importlib.import_module("lumigraph.deconvolution.deconvolve")  # the function has its name, too
    calls, widened = [], module.beyond
    monkeypatch.setattr(module, "beyond", lambda operator: calls.append(1) or widened(operator))
    frame = lg.open(tmp_path / "raw.tiff").data
    tifffile.imwrite(tmp_path / "film.tif", np.stack([frame, 2 * frame]).astype(np.uint16))
    said = ("deconvolve", "film.tif", "--page", "all", "--camera", "camera.toml", "--iterations", 2)
    found = focused(*said, "-o", "picture.tiff")
    assert (found.code, len(calls)) == (0, 1), found.err
    pictures = [lg.open(path).data for path in sorted(tmp_path.glob("picture*.tiff"))]
    np.testing.assert_allclose(pictures[1], 2 * pictures[0], rtol=0.02, atol=0.02 * pictures[1].max())


def test_a_page_of_a_series_is_judged_by_its_own_pixels(focused, tmp_path):
    """Those that are full on the first one counted on the second, and the other way round."""
    frame = lg.open(tmp_path / "raw.tiff").data.astype(np.uint16)
    film = np.stack([frame, frame, 0 * frame])
    film[0, 5:9, 5:9] = film[1, 30:40, 20:30] = 65535
    tifffile.imwrite(tmp_path / "film.tif", film, photometric="minisblack")
    said = ("deconvolve", "film.tif", "--camera", "camera.toml", "--iterations", 2, "--page")
    assert focused(*said, "0:1", "-o", "all.tiff").code == 0
    for page in (0, 1):
        assert focused(*said, page, "-o", "one.tiff").code == 0
        alone, mine = (lg.open(tmp_path / name).data for name in ("one.tiff", f"all-page-{page}.tiff"))
        np.testing.assert_array_equal(mine, alone)
    dark = focused(*said, "all", "-o", "all.tiff")
    assert (dark.code, "page 2: the raw image is dark" in dark.err) == (1, True), dark.err


def test_a_microscope_gives_a_volume_with_its_places(lumigraph, tmp_path):
    """White and dark images, as a microscopist takes them; the bead comes back where it was."""
    (tmp_path / "scope.toml").write_text(SCOPE)
    scope = lg.load_camera(tmp_path / "scope.toml")
    operator = scope.operator((-10e-6, 0.0, 10e-6), 5)
    scene = np.zeros(operator.shape[1], np.float32)
    ny, nx = operator.object_grid.shape
    scene[2, ny // 2 + 3, nx // 2 - 4] = 1e5
    light = np.maximum(operator.forward(scene), 0)
    lg.save(lg.RawImage((light + 10).astype(np.float32)), tmp_path / "raw.tif")
    lg.save(lg.RawImage(np.full(light.shape, 10, np.float32)), tmp_path / "dark.tif")
    found = lumigraph(
        "deconvolve", "raw.tif", "--dark", "dark.tif", "--camera", "scope.toml", "--iterations", 15,
        "--depth", "-10 um:10 um:10 um", "-o", "volume.ome.tif", "--report", "page.html", "--raw-lattice",
    )  # fmt: skip
    assert found.code == 0, found.err
    volume = lg.open(tmp_path / "volume.ome.tif")
    assert isinstance(volume, lg.Volume)
    assert volume.depths == pytest.approx((-10e-6, 0.0, 10e-6))
    assert volume.grid.pitch == pytest.approx(operator.object_grid.pitch)
    assert np.unravel_index(np.argmax(volume.data), volume.shape) == (2, ny // 2 + 3, nx // 2 - 4)
    assert (tmp_path / "page.html").read_text().count("<img") == 4


def test_depths_are_read_with_their_ends():
    assert planes("--depth", "-20 um:20 um:2 um") == pytest.approx(np.arange(-20e-6, 21e-6, 2e-6))
    assert planes("--depth", "5 um") == pytest.approx((5e-6,))
    assert planes("--depth", "5 um, -1 um") == pytest.approx((-1e-6, 5e-6))


def test_vignetting_is_what_a_white_image_shows_over_many_lenslets():
    y, x = np.indices((120, 140))
    slow = 1 - 0.4 * (x / 140)
    white = 900 * slow * (1 + 0.5 * np.cos(2 * np.pi * x / 10) * np.cos(2 * np.pi * y / 10))
    found = vignetting(white, 10.0)
    inner = (slice(30, 90), slice(30, 110))
    np.testing.assert_allclose(found[inner] / slow[inner], np.mean(found[inner] / slow[inner]), rtol=0.03)
    assert found.max() <= 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--depth", "1 um:2 um"), "must be first:last:step"),
        (("--depth", "2 um:1 um:1 um"), "must lead from its first to its last value"),
        (("--depth", "0 um:1 m:1 nm"), "must have 1 to 1000"),
        (("--depth", "1 um, 1 um"), "names a depth twice"),
        (("--depth", "3"), "--depth"),
        (("--samples", "0"), "--samples is 0"),
        (("--iterations", "0"), "--iterations is 0"),
        (("--strength", "0.1"), "--strength needs a prior"),
        (("--strength", "nan", "--prior", "tv"), "--strength is nan"),
        (("--deviance", "-1"), "--deviance is -1"),
        (("--change", "0"), "--change is 0"),
        (("--background", "-1"), "--background is -1"),
        (("--background", "1", "--dark", "raw.tiff"), "both give the dark"),
        (("--dark", "small.tiff"), "the dark image has shape (4, 4)"),
        (("--report", "page.txt"), "wrong extension"),
        (("--checkpoint", "state.txt"), "must end in .npz"),
        (("--camera", "thesis-2f"), "error:"),
        (("--warm",), "there is one page"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments, message, lumigraph, tmp_path):
    (tmp_path / "camera.toml").write_text(FOCUSED)
    lg.save(np.ones((51, 51), np.float32), tmp_path / "raw.tiff")
    lg.save(np.ones((4, 4), np.float32), tmp_path / "small.tiff")
    camera = () if "--camera" in arguments else ("--camera", "camera.toml")
    found = lumigraph("deconvolve", "raw.tiff", *camera, *arguments, "-o", "out.tiff")
    assert found.code == 1, found
    assert message in found.err
    assert found.err.count("\n") == 1
    assert not (tmp_path / "out.tiff").exists()


def test_what_a_microscope_would_see_can_be_simulated_and_deconvolved(lumigraph, tmp_path):
    (tmp_path / "scope.toml").write_text(SCOPE)
    found = lumigraph(
        "simulate", "scope.toml", "--point", "4 um, -6 um, 10 um", "--scene", "siemens_star",
        "--depth", "-5 um", "--accuracy", 1e-2, "-o", "raw.tiff",
    )  # fmt: skip
    assert found.code == 0, found.err
    found = lumigraph(
        "deconvolve", "raw.tiff", "--camera", "scope.toml", "--depth", "-5 um, 10 um", "--iterations", 2,
        "-o", "volume.ome.tif",
    )  # fmt: skip
    assert found.code == 0, found.err
    found = lumigraph("simulate", "scope.toml", "--scene", "white", "--coherence", "coherent", "-o", "w.tiff")
    assert found.code == 1
    assert "fluorescence, which does not interfere. Leave coherence out" in found.err


def test_a_single_lens_is_deconvolved_too(lumigraph, tmp_path):
    (tmp_path / "lens.toml").write_text(LENS)
    lumigraph("simulate", "lens.toml", "--scene", "siemens_star", "--noise", "-o", "raw.tiff")
    words = ("deconvolve", "raw.tiff", "--camera", "lens.toml", "--iterations", 3, "-o")
    found = lumigraph(*words, "picture.tiff", "--json")
    assert found.code == 0, found.err
    assert lg.open(tmp_path / "picture.tiff").shape == tuple(json.loads(found.out)["shape"])
    refused = lumigraph(*words, "other.tiff", "--samples", 3)
    assert refused.code == 1
    assert "has no lenslets to count --samples by" in refused.err


def test_a_batch_warms_up_in_runs_that_are_the_same_whoever_does_them(here, lumigraph, tmp_path, rng):
    """Frames 0 and 1 are those of the verb's own --warm; 2 begins cold, as if it stood alone."""
    (tmp_path / "scope.toml").write_text(SCOPE)
    film = rng.poisson(200, (3, 41, 41)).astype(np.uint16)
    tifffile.imwrite(tmp_path / "film.tif", film, photometric="minisblack")
    asked = [
        "film.tif",
        "--camera",
        "scope.toml",
        "--depth=-10 um,0 um",
        "--samples",
        "1",
        "--iterations",
        "2",
    ]
    batch = ["batch", "deconvolve", *asked, "--warm", "--run", "2", "--workers", "1"]
    found = lumigraph(*batch, "-o", "v.ome.zarr")
    assert found.code == 0, found.err
    assert "2 of 2 runs of 2 frames are done" in found.out
    assert lumigraph("deconvolve", *asked, "--warm", "--page", "0:1", "-o", "w.ome.zarr").code == 0
    assert lumigraph("deconvolve", *asked, "--page", "2", "-o", "c.ome.zarr").code == 0
    for page, alone in enumerate(("w-page-0.ome.zarr", "w-page-1.ome.zarr", "c.ome.zarr")):
        mine = lg.open(tmp_path / "v.ome.zarr", page=page)
        np.testing.assert_array_equal(mine.data, lg.open(tmp_path / alone).data)
    assert lumigraph("deconvolve", *asked, "--page", "1", "-o", "d.ome.zarr").code == 0
    cold = lg.open(tmp_path / "d.ome.zarr").data
    assert not np.array_equal(lg.open(tmp_path / "v.ome.zarr", page=1).data, cold)
    (tmp_path / "v.ome.zarr.ledger/done/000000.json").unlink()  # as if killed in the first run
    (tmp_path / "v.ome.zarr/0/c/1/0/0/0").unlink()
    assert lumigraph(*batch, "-o", "v.ome.zarr").code == 0
    again = lg.open(tmp_path / "v.ome.zarr", page=1)
    np.testing.assert_array_equal(again.data, lg.open(tmp_path / "w-page-1.ome.zarr").data)


def test_frames_of_a_batch_that_share_products_are_what_the_verb_alone_gives(
    lumigraph, tmp_path, rng, monkeypatch
):
    """Three at a time; of those with another picture's lenslets, or none to see, none suffers."""
    (tmp_path / "scope.toml").write_text(SCOPE)
    film = rng.poisson(200, (6, 41, 41)).astype(np.uint16)
    film[1] = 0
    tifffile.imwrite(tmp_path / "film.tif", film, photometric="minisblack")
    asked = ["--camera", "scope.toml", "--depth=-10 um,0 um", "--samples", "1", "--iterations", "2"]
    monkeypatch.setattr(MicroscopeOperator, "side_by_side", property(lambda _: 3))
    monkeypatch.chdir(tmp_path)
    work, (first, *others) = Frames("deconvolve", tuple(asked), str(tmp_path)), items_of(["film.tif"], "all")
    assert work.side_by_side == 4
    changed = {**others[3], "size": 7}
    groups = list(work.several([first, *others[:3], changed, others[4]]))
    assert [len(group) for group in groups] == [3, 3]
    found = [thing for group in groups for thing in group]
    assert "is dark" in str(found.pop(1))
    assert "has changed since the batch began" in str(found.pop(3))
    for page, volume in zip((0, 2, 3, 5), found, strict=True):
        assert (
            lumigraph("deconvolve", "film.tif", *asked, "--page", str(page), "-o", "one.ome.zarr").code == 0
        )
        np.testing.assert_array_equal(lg.open(tmp_path / "one.ome.zarr").data, volume.data)
    (refused,) = next(Frames("deconvolve", (*asked, "--deviance", "1"), str(tmp_path)).several([first]))
    assert "does not say how many make a value" in str(refused)


PLENOPTIC = """
kind = "plenoptic"
wavelength = "550 nm"
object_distance = "200 mm"
[main_lens]
focal_length = "100 mm"
[lenslets]
pitch = "100 um"
focal_length = "2.5 mm"
count = [3, 3]
[sensor]
pixel_pitch = "10 um"
"""


@pytest.fixture
def rough(monkeypatch):
    """Joint operators to 1e-2, which take less time; what is tested is which raw images go where."""
    module = importlib.import_module("lumigraph.metrology.scanning.joint")
    monkeypatch.setattr(module, "joint_operator", functools.partial(module.joint_operator, accuracy=1e-2))


@pytest.fixture
def scanned(rough, lumigraph, tmp_path):
    """A camera file and raw images of a blob, moved by halves of a lenslet, the last four times as long."""
    (tmp_path / "camera.toml").write_text(PLENOPTIC)
    camera = lg.load_camera(tmp_path / "camera.toml")
    at = lg.Grid((25, 25), (4e-6, 4e-6))
    blob = np.exp(-((at.y[:, None] ** 2 + at.x**2) / (2 * 12e-6**2)))
    for number, (y, x) in enumerate(lg.scan(2, camera.lenslet_size)):
        there = lg.Grid(at.shape, at.pitch, (30e-6 + y, -20e-6 + x))
        light = lg.simulate(camera, lg.Scene([lg.Slice(blob, there)]), lg.Incoherent(1e-2)).data
        raw = camera.sensor.expose(np.maximum(light, 0), photons=4000 if number == 3 else 1000)
        tifffile.imwrite(tmp_path / f"raw{number}.tif", raw.data)
    return lumigraph


FILES = [f"raw{k}.tif" for k in range(4)]


def test_raw_images_of_a_moved_object_are_deconvolved_together(scanned, tmp_path):
    said = ("deconvolve", *FILES, "--camera", "camera.toml", "--iterations", 10, "--samples", 6)
    found = scanned(*said, "--shifts", "2x2", "--light", "1,1,1,4", "-o", "picture.tiff")
    assert found.code == 0, found.err
    assert "times as bright" not in found.err
    picture = lg.open(tmp_path / "picture.tiff")
    pairs = "; ".join(f"{y} um, {x} um" for y in (-25, 25) for x in (-25, 25))
    assert scanned(*said, "--shifts", pairs, "--light", "1,1,1,4", "-o", "pairs.tiff").code == 0
    np.testing.assert_allclose(lg.open(tmp_path / "pairs.tiff").data, picture.data, rtol=1e-4, atol=1e-3)
    camera = lg.load_camera(tmp_path / "camera.toml")
    shifts = lg.scan(2, camera.lenslet_size)
    grid = lg.joint_operator(camera, None, 6, shifts=shifts, accuracy=1e-2).object_grid
    light = picture.data / picture.data.sum()
    assert (light.sum(1) @ grid.y, light.sum(0) @ grid.x) == pytest.approx((30e-6, -20e-6), abs=3e-6)
    dim = scanned(*said[:-4], "--iterations", 1, *said[-2:], "--shifts", "2x2", "-o", "dim.tiff")
    assert "times as bright" in dim.err + dim.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([*FILES[:3], "--shifts", "2x2"], "--shifts is for 4 raw images, but there are 3"),
        ([*FILES[:1], "--shifts", "1x1"], "are of several raw images"),
        ([*FILES[:1], "--find-shifts"], "--find-shifts are between several raw images"),
        ([*FILES[:2], "--shifts", "2x3"], "a scan is square"),
        ([*FILES[:2], "--shifts", "1 um; 2 um"], "must be pairs"),
        ([*FILES[:2], "--shifts", "1 kg, 0 um; 0 um, 0 um"], "--shifts"),
        ([*FILES[:2], "--light", "1,0"], "numbers above 0"),
        ([*FILES[:2], "--light", "1,1,1"], "--light is for 3 raw images"),
        ([FILES[0], "film.tif", "--page", "all"], "film.tif has 2 pages, a time series"),
    ],
)
def test_what_is_no_set_of_raw_images_is_refused(lumigraph, tmp_path, words, message):
    (tmp_path / "camera.toml").write_text(PLENOPTIC)
    for name in FILES:
        tifffile.imwrite(tmp_path / name, np.ones((9, 9), np.uint16))
    tifffile.imwrite(tmp_path / "film.tif", np.ones((2, 9, 9), np.uint16))
    found = lumigraph("deconvolve", *words, "--camera", "camera.toml", "-o", "picture.tiff")
    assert found.code != 0
    assert message in " ".join(found.err.split())


def test_shifts_are_found_before_raw_images_are_deconvolved_together(rough, lumigraph, tmp_path):
    (tmp_path / "camera.toml").write_text(PLENOPTIC.replace("[3, 3]", "[7, 7]"))
    camera = lg.load_camera(tmp_path / "camera.toml")
    own, rng = camera.operator_grid(8), np.random.default_rng(3)
    grid = lg.Grid(tuple(n + 32 for n in own.shape), own.pitch, own.center)
    true = lg.scan(2, camera.lenslet_size) + np.array([(0, 0), (9e-6, -7e-6), (-5e-6, 12e-6), (8e-6, 4e-6)])
    joint = lg.joint_operator(camera, None, 8, shifts=true, grid=grid, accuracy=1e-2)
    texture = gaussian_filter(rng.standard_normal(grid.shape), 2)
    picture = np.clip(0.5 + 0.15 * texture / texture.std(), 0, None).astype(np.float32)
    for number, light in enumerate(joint.parted(joint.forward(picture))):
        lg.save(camera.sensor.expose(light, photons=1000, rng=rng), tmp_path / f"raw{number}.tif")
    said = ("deconvolve", *FILES, "--camera", "camera.toml", "--iterations", 2, "--samples", 6)
    found = lumigraph(*said, "--shifts", "2x2", "--find-shifts", "--json", "-o", "picture.tiff")
    assert found.code == 0, found.err
    told = json.loads(found.out)["found_shifts"]
    shifts, errors = np.array(told["shifts"]), np.array(told["errors"])
    off = ((shifts - shifts[0]) - (true - true[0]))[1:]
    assert np.abs(off).max() < 6e-6  # as the stage was told: 12e-6
    assert np.abs(off / errors[1:]).max() < 3
    assert 0 < errors[1:].max() < 4e-6
