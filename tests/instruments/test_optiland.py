"""The prescription of a double Gauss through Optiland, where that is installed."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import FormatError, GeometryError
from lumigraph.io.prescription import Prescription
from lumigraph.operators.lenslets.point_light import point_light
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.glass_distortion import seen_points
from lumigraph.operators.single_lens import points_image
from lumigraph.samples import lens_path

pytest.importorskip("optiland")
pytestmark = pytest.mark.filterwarnings("ignore")

F, Z1, PIXEL, COUNT = 0.04996, 0.5, 0.35e-6, 64


@pytest.fixture(scope="module")
def camera():
    """Sees 5.5 degrees from the axis."""
    with lens_path() as path:
        yield lg.SingleLensCamera(
            wavelength="550 nm", object_distance=Z1,
            main_lens={"focal_length": F, "diameter": 0.01, "prescription": path},
            sensor={"pixel_pitch": "4 um", "shape": (1889, 1889)},
        )  # fmt: skip


@pytest.fixture(scope="module")
def lens(camera):
    """As the camera has it: the same planes, the same stop."""
    found = Prescription(camera.main_lens.prescription)
    focal_length = found.first_order(550e-9).focal_length
    found.focus(Z1, 1 / (1 / focal_length - 1 / Z1) + camera.glass.defocus, camera.glass.entrance_pupil)
    return found


@pytest.mark.parametrize("part", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("wavelength", [450e-9, 550e-9, 650e-9])
def test_a_point_is_imaged_as_by_huygens(camera, lens, part, wavelength):
    """Optiland's own sum over its rays, on its own places; another field or the ideal lens fails."""
    from optiland.psf import HuygensPSF

    far = camera.glass.aberrations.x[-1] / 1.05
    at = lens.trace(550e-9, np.array([0.0, part * far * Z1, far * Z1]), np.zeros((1, 2))).height[1, 0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        psf = HuygensPSF(lens._lens, (0, part), wavelength * 1e6, 128, COUNT, pixel_pitch=PIXEL * 1e3)
    middle = float(np.ravel(psf.cy)[0]) * 1e-3 - at
    places = np.linspace(-COUNT / 2, COUNT / 2, COUNT) * PIXEL
    one = replace(camera.optics(), wavelength=wavelength)

    def off(field):
        seen = np.interp(field, camera.glass.aberrations.x, camera.traced.fields)
        light = point_light(field_lenses.at(one, 0.0, seen), one.object_distance, 4e-5)
        found, expected = np.abs(light.at(places, places + middle)).T ** 2, np.asarray(psf.psf)
        share = np.sum(found * expected) / np.sum(found**2)
        return np.linalg.norm(share * found - expected) / np.linalg.norm(expected)

    assert off(part * far) < 6e-3
    if part:
        assert off(0.0) > 0.05


def test_wavelengths_between_those_that_were_traced(camera, lens):
    """Terms at 480 nm by the spline over wavelengths, against a camera of 480 nm in the same plane."""
    own = camera.replace(wavelength="480 nm")
    refocused = own.glass.defocus - camera.glass.defocus
    for field in (0.0, 0.06):
        one, other = (c.glass.aberrations.at(0.0, field, 480e-9) for c in (camera, own))
        assert {j for j in one if j != 4 and abs(one[j] - other[j]) > 0.02} <= {2}
    assert abs(refocused) < 1e-3


def test_the_patent_is_of_one_inch(lens):
    first = lens.first_order(587.6e-9)
    assert first.focal_length == pytest.approx(0.05, rel=2e-3)
    assert first.pupil_magnification == pytest.approx(1.256, rel=1e-3)


def test_optilands_json_is_the_same(camera, tmp_path):
    from optiland.fileio import save_optiland_file

    path = tmp_path / "lens.json"
    save_optiland_file(Prescription(camera.main_lens.prescription)._lens, str(path))
    other = camera.replace(main_lens={"prescription": path})
    one, two = (c.glass.aberrations.at(0.01, 0.05, 550e-9) for c in (camera, other))
    assert one == pytest.approx(two, abs=1e-9)


@pytest.mark.parametrize("what", ["pickups", "solves"])
def test_surfaces_that_follow_others_are_refused(camera, tmp_path, what):
    """Placing the image plane would move them without a word."""
    from optiland.fileio import save_optiland_file

    path, lens = tmp_path / "lens.json", Prescription(camera.main_lens.prescription)._lens
    given = {"pickups": (1, "radius", 2), "solves": ("marginal_ray_height", 12, 0.0)}[what]
    getattr(lens, what).add(*given)
    save_optiland_file(lens, str(path))
    with pytest.raises(GeometryError, match="pickups or solves"):
        Prescription(path)


def test_the_drawing_shows_rays_on_the_spheres_of_the_file(camera):
    """With radii and distances as written; rays meet in the image, the chief ray amid the stop."""
    drawn, lines = camera.layout().glass, camera.main_lens.prescription.read_text().splitlines()
    curvatures, gaps = (
        [float(line.split()[1]) for line in lines if line.split()[:1] == [key]][1:-1]
        for key in ("CURV", "DISZ")
    )
    vertices = np.concatenate(([0.0], np.cumsum(gaps[:-1]))) * 1e-3
    assert drawn.surfaces.shape[:2] == (11, 2)
    for places in (drawn.rays[:, :, 1:-1], drawn.surfaces.transpose(2, 1, 0)):
        z, y = places[:, 0], places[:, 1]
        c = np.array(curvatures) * 1e3
        np.testing.assert_allclose(z, vertices + c * y**2 / (1 + np.sqrt(1 - c**2 * y**2)), atol=1e-9)
    assert drawn.stop == 5
    chief = drawn.rays[len(drawn.rays) // 2 + 2, 1]
    assert abs(chief[1 + drawn.stop]) < 1e-8
    at_image = drawn.rays[5:, 1, -1]
    assert np.ptp(at_image) < 2e-4 < abs(at_image).min()
    assert chief[0] / at_image[2] == pytest.approx(-Z1 / (1 / (1 / F - 1 / Z1)), rel=0.02)
    assert drawn.is_glass == (True, False, True, True, False, False, True, True, False, True, False)


def test_more_light_than_the_file_opens_to_is_refused(camera):
    with pytest.raises(GeometryError, match="opens to"):
        _ = camera.replace(main_lens={"diameter": 0.03}).glass


def test_apertures_that_cut_light_off_are_refused(camera, tmp_path):
    text = camera.main_lens.prescription.read_text().replace("SURF 11\n", "SURF 11\n  FLAP 0 5 0\n")
    path = tmp_path / "cut.zmx"
    path.write_text(text)
    with pytest.raises(GeometryError, match="end at an aperture"):
        _ = camera.replace(main_lens={"prescription": path}).glass


@pytest.mark.parametrize("text", ["", "MODE SEQ\n", "ENPD 10\nSURF 0\n"])
def test_files_that_are_no_lens_are_one_line(camera, tmp_path, text):
    path = tmp_path / "none.zmx"
    path.write_text(text)
    with pytest.raises((FormatError, GeometryError), match=r"none\.zmx"):
        _ = camera.replace(main_lens={"prescription": path}).glass


def first_glass(tmp_path, text):
    """The double Gauss with another first glass."""
    whole, file = lens_path(), tmp_path / "lens.zmx"
    with whole as path:
        file.write_text(path.read_text().replace("___BLANK 1 0 1.61 53.3", text))
    return file


def test_another_glass_of_the_same_name_is_refused(tmp_path):
    with pytest.raises(GeometryError, match=r"N-BK7 of index 1.61 at surface 1, .* takes 1.5168"):
        Prescription(first_glass(tmp_path, "N-BK7 0 0 1.61 53.3"))
    assert Prescription(first_glass(tmp_path, "N-BK7 0 0 1.5168 64.17")).notes == ()


def test_a_glass_of_no_catalogue_is_noted(tmp_path):
    (note,) = Prescription(first_glass(tmp_path, "N-NONE7 0 0 1.61 53.3")).notes
    assert note == "N-NONE7 is in no catalogue: it is followed by its index and Abbe number"


def test_a_point_stands_where_optilands_chief_ray_arrives(camera, lens):
    """Of fields that were not traced for it; a thin lens has the farther one 4 µm off."""
    heights = Z1 * np.array([0.031, 0.062])
    arrived = lens.trace(550e-9, heights, np.zeros((1, 2))).height[:, 0]
    points = lg.Points(np.array([[0.0, height, 0.0] for height in heights]), np.ones(2))
    thin, seen = seen_points(camera.optics(), points)
    places = -seen.positions[:, 1] * thin.separation / thin.object_distance
    assert places == pytest.approx(arrived, abs=5e-8)
    assert abs(heights[1] * camera.magnification + arrived[1]) > 3e-6


def test_a_points_image_is_there(camera, lens):
    strip = camera.replace(sensor={"pixel_pitch": "10 um", "shape": (3, 721)})
    raw, _ = points_image(strip, lg.Points(np.array([[0.0, 0.031 * Z1, 0.0]]), np.ones(1)))
    at, line = (np.arange(raw.shape[1]) - raw.shape[1] // 2) * 10e-6, raw.sum(0)
    near = np.abs(at - 0.031 * Z1 * camera.magnification) < 2e-4
    y, x = np.meshgrid(*2 * [np.linspace(-1, 1, 41)], indexing="ij")
    pupil = np.stack([y, x], axis=-1)[np.hypot(y, x) < 1]
    mean = np.nanmean(lens.trace(550e-9, np.array([0.0, 0.031 * Z1]), pupil).height[1])
    assert (line @ (at * near)) / (line @ near) == pytest.approx(-mean, abs=5e-7)


@pytest.fixture
def plenoptic(camera):
    return lg.PlenopticCamera(
        wavelength="550 nm", object_distance=Z1,
        main_lens={"focal_length": F, "diameter": 0.01, "prescription": camera.main_lens.prescription},
        lenslets={"pitch": "100 um", "focal_length": "0.55 mm", "count": (13, 13)},
        sensor={"pixel_pitch": "5 um"},
    )  # fmt: skip


def test_points_of_a_plenoptic_camera_take_the_lens(plenoptic):
    far = math.tan(math.radians(0.5)) * Z1
    points = lg.targets.points([(0.0, 0.0), (far / 2, far)])
    real, ideal = (
        np.asarray(lg.simulate(c, points, lg.Incoherent(1e-2)).data)
        for c in (plenoptic, plenoptic.replace(main_lens={"prescription": None}))
    )
    assert real.sum() == pytest.approx(ideal.sum(), rel=0.02)
    assert np.linalg.norm(real - ideal) > 1e-3 * np.linalg.norm(ideal)
