"""Light of several wavelengths: colours, Bayer filters, and the operator of a band."""

from dataclasses import replace

import numpy as np
import pytest

import cameras
import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.errors import FormatError, GeometryError, SamplingError
from lumigraph.scene import Points, Scene, Slice, SpectralLine
from lumigraph.simulation import Incoherent, Spectrum, simulate
from lumigraph.studies.information.points import CameraSource
from lumigraph.units import nm, um

ROUGH = Incoherent(accuracy=1e-2)


@pytest.fixture(scope="module")
def camera():
    return cameras.focused(count=(3, 3), pixel_pitch=8 * um)


def picture(camera, channels):
    shape = (*camera.object_grid.shape, channels)
    data = np.zeros(shape, np.float32)
    data[shape[0] // 2 :, :, 0] = 1
    data[:, shape[1] // 2 :, -1] = 0.5
    return Scene([Slice(data if channels > 1 else data[..., 0], camera.object_grid)])


def test_each_colour_is_the_image_at_its_own_wavelength(camera):
    scene, spectrum = picture(camera, 3), Spectrum.rgb(620 * nm, 540 * nm, 460 * nm)
    raw = simulate(camera, scene, ROUGH, spectrum=spectrum)
    assert raw.data.shape == (*camera.sensor.shape, 3)
    assert raw.metadata["wavelength"] == (620 * nm, 540 * nm, 460 * nm)
    for k, wavelength in enumerate(spectrum.wavelengths):
        part = Slice(scene.parts[0].intensity[..., k], camera.object_grid)
        alone = simulate(camera.replace(wavelength=wavelength), Scene([part]), ROUGH)
        np.testing.assert_array_equal(raw.data[..., k], alone.data)


def test_a_lines_error_is_counted_and_told(camera):
    """Of 10 nm over 30 um, by wavelengths that leave 1e-3."""
    line = Spectrum.line(SpectralLine(550 * nm, 10 * nm), 30 * um)
    known = simulate(camera, picture(camera, 1), ROUGH, spectrum=line).metadata["error"]
    alike = simulate(camera, picture(camera, 1), ROUGH, spectrum=replace(line, error=0.0)).metadata["error"]
    assert 1e-5 < line.error <= 1e-3
    assert known["rms"] == pytest.approx(alike["rms"] + line.error)
    assert (
        known["source"]
        == f"{alike['source']}; coherence of {len(line.wavelengths)} wavelengths to {line.error:.2g}"
    )


def test_a_bayer_filter_shows_one_colour_to_each_pixel(camera):
    scene = picture(camera, 3)
    colours = simulate(camera, scene, ROUGH, spectrum=Spectrum.rgb()).data
    raw = simulate(camera, scene, ROUGH, spectrum=Spectrum.rgb(bayer="GRBG"))
    assert raw.bayer == "GRBG"
    np.testing.assert_array_equal(raw.data[::2, 1::2], colours[::2, 1::2, 0])
    np.testing.assert_array_equal(raw.data[1::2, ::2], colours[1::2, ::2, 2])


def test_a_band_is_the_mean_of_its_wavelengths_and_so_is_its_operator(camera):
    band = Spectrum.band(600 * nm, 660 * nm, 2)
    operator = camera.operator(spectrum=band, accuracy=1e-2, samples_per_lenslet=4)
    x = np.random.default_rng(0).random(operator.shape[1]).astype(np.float32)
    y = np.random.default_rng(1).random(operator.shape[0]).astype(np.float32)
    single = [
        camera.replace(wavelength=w).operator(accuracy=1e-2, samples_per_lenslet=4).forward(x)
        for w in (600 * nm, 660 * nm)
    ]
    image = operator.forward(x)
    np.testing.assert_allclose(image, (single[0] + single[1]) / 2, rtol=1e-5)
    assert (image.astype(float) * y).sum() == pytest.approx(
        (x * operator.adjoint(y).astype(float)).sum(), rel=1e-6
    )
    scene = Scene([Slice(x, operator.object_grid)])
    np.testing.assert_allclose(simulate(camera, scene, ROUGH, spectrum=band).data, image, atol=1e-4)
    assert operator.psf((2, 3)).sum() > 0


def test_progress_counts_over_all_wavelengths(camera):
    seen = []
    simulate(camera, picture(camera, 3), ROUGH, spectrum=Spectrum.rgb(), progress=seen.append)
    assert {1 / 3, 2 / 3, 1} <= set(seen)
    assert seen == sorted(seen)


def test_what_a_spectrum_cannot_be(camera):
    with pytest.raises(GeometryError, match=r"weights have shape \(2, 1\) but must have a row for each of 1"):
        Spectrum((500 * nm,), ((1.0,), (1.0,)))
    with pytest.raises(GeometryError, match="at least 0, and above 0 somewhere in each channel"):
        Spectrum((500 * nm,), ((0.0,),))
    with pytest.raises(GeometryError, match="'RGGB' but the weights have 1 channel"):
        Spectrum((500 * nm,), ((1.0,),), "RGGB")
    with pytest.raises(GeometryError, match="a slice has 3 colours but the spectrum has 1 channels"):
        simulate(camera, picture(camera, 3), ROUGH, spectrum=Spectrum.band(500 * nm, 600 * nm, 1))
    with pytest.raises(GeometryError, match="whose wavelength cannot be replaced"):
        simulate(object(), picture(camera, 3), ROUGH, spectrum=Spectrum.rgb())
    with pytest.raises(GeometryError, match="the operator has one channel but the spectrum has three"):
        camera.operator(spectrum=Spectrum.rgb())
    with pytest.raises(GeometryError, match=r"Give spectrum=Spectrum.rgb\(\) for a coloured scene"):
        simulate(camera, picture(camera, 3), ROUGH)


CURVES = """# a lamp behind three filters
wavelength [nm], light, red, green, blue
420, 0.4, 0, 0, 0.9
480, 0.7, 0, 0.3, 0.8
540, 0.9, 0.1, 1, 0.1
600, 1.0, 0.9, 0.3, 0
660, 1.0, 0.6, 0, 0
"""


def test_curves_are_their_moments(tmp_path):
    """Gauss's nodes keep the mean and the variance of a channel's wavelengths."""
    (tmp_path / "curves.csv").write_text(CURVES)
    found = Spectrum.load(tmp_path / "curves.csv", 10 * um, bayer="RGGB")
    assert (found.bayer, len(found.weights[0])) == ("RGGB", 3)
    assert 0 < found.error <= 1e-2
    at = np.linspace(420, 660, 24001) * nm
    values = np.array([row.split(",") for row in CURVES.splitlines()[2:]], float)
    wavelengths, weights = np.array(found.wavelengths), np.array(found.weights)
    for k in range(3):
        light = np.interp(at, values[:, 0] * nm, values[:, 1] * values[:, 2 + k])
        for power in (1, 2, 3):
            expected = float((light * at**power).sum() / light.sum())
            assert weights[:, k] @ wavelengths**power == pytest.approx(expected, rel=1e-4)
    ways = np.linspace(0, 10 * um, 57)
    seen = np.exp(2j * np.pi * np.outer(ways, 1 / wavelengths)) @ weights[:, 2]
    light = np.interp(at, values[:, 0] * nm, values[:, 1] * values[:, 4])
    whole = np.exp(2j * np.pi * np.outer(ways, 1 / at)) @ light / light.sum()
    assert np.abs(seen - whole).max() < 1.02 * found.error


def test_a_thin_line_of_a_curve_is_not_passed_over():
    """Of 0.01 nm, where curves are followed in steps of 0.1 nm."""
    line = Spectrum.curves([4e-7, 5.4999e-7, 5.5e-7, 5.5001e-7, 8e-7], [0, 0, 1, 0, 0], 10 * um)
    assert line.wavelengths == pytest.approx([5.5e-7])


def test_pictures_through_curves_are_those_of_many_wavelengths(camera):
    at, response = np.linspace(450, 650, 5) * nm, [0, 0.5, 1, 0.8, 0]
    scene = picture(camera, 1)
    few = Spectrum.curves(at, response, camera.path_difference)
    many = Spectrum.curves(at, response, camera.path_difference, accuracy=1e-5)
    one = Spectrum((float(np.dot(few.wavelengths, few.weights)[0]),), ((1.0,),))
    images = [simulate(camera, scene, ROUGH, spectrum=each).data for each in (many, few, one)]
    off, alone = (np.linalg.norm(image - images[0]) / np.linalg.norm(images[0]) for image in images[1:])
    assert len(one.wavelengths) < len(few.wavelengths) < len(many.wavelengths)
    assert off < 5e-3 < alone


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"wavelengths": [5e-7, 4e-7]}, "must be finite, above 0 m, and rise"),
        ({"wavelengths": [-5e-7, 4e-7]}, "above 0 m"),
        ({"wavelengths": [5e-7]}, "Give two wavelengths at least"),
        ({"responses": [1, -1]}, "at least 0"),
        ({"responses": [[1, 0, 0], [1, 0, 1]]}, "above 0 somewhere in each channel"),
        ({"responses": [1, np.nan]}, "finite"),
        ({"light": [1, 1, 1]}, r"light \(3,\)"),
        ({"light": [0, 0]}, "above 0 somewhere"),
        ({"accuracy": 0}, "between 0 and 1"),
        ({"path_difference": 1.0}, "40 wavelengths leave"),
    ],
)
def test_wrong_curves_are_refused(changes, match):
    given = {"wavelengths": [4e-7, 5e-7], "responses": [1, 1], "path_difference": 5e-6} | changes
    with pytest.raises((GeometryError, SamplingError), match=match):
        Spectrum.curves(**given)


@pytest.mark.parametrize(
    "titles", ["wavelength, response", "wavelength [nm], red", "response, wavelength [nm]"]
)
def test_files_of_curves_name_their_columns(tmp_path, titles):
    (tmp_path / "curves.csv").write_text(f"{titles}\n400, 1\n500, 1\n")
    with pytest.raises(FormatError, match="Name them 'wavelength"):
        Spectrum.load(tmp_path / "curves.csv", 5e-6)


@pytest.mark.parametrize("kind", ["one lens", "2.0", "2.0, past an edge"])
def test_a_white_point_is_white(kind, camera):
    """As a slice of one sample is: within 5 %; by each wavelength's own samples it was 1.4 : 1 : 0.7."""
    one = lg.SingleLensCamera(
        wavelength=550 * nm, object_distance=0.2, main_lens={"focal_length": 0.05, "diameter": 2e-3},
        sensor={"pixel_pitch": 7 * um, "shape": (101, 101)},
    )  # fmt: skip
    parts: list[Slice | Points] = [Points(np.array([[2e-5, -1e-5, 2e-3]]), np.ones(1))]
    if kind.endswith("edge"):
        cover = np.zeros((40, 40), np.float32)
        cover[:20] = 1
        parts.append(Slice(0 * cover, Grid.square(40, 50 * um), dz=-5e-3, opacity=cover))
    spectrum = Spectrum.rgb(650 * nm, 550 * nm, 450 * nm)
    raw = simulate(one if kind == "one lens" else camera, Scene(parts), ROUGH, spectrum=spectrum)
    energy = raw.data.sum((0, 1), dtype=float)
    assert np.ptp(energy) < 0.05 * energy.mean()


def test_light_of_a_points_bounds_is_the_same_at_all_wavelengths(camera):
    place = np.array([2e-5, -1e-5, 1e-3])
    seen = [camera.at_wavelength(w) for w in (450 * nm, 550 * nm, 650 * nm)]
    light = [CameraSource(one, 1e-2).image(place).sum() for one in seen]
    assert np.ptp(light) < 0.05 * np.mean(light)  # more light of longer waves falls beside the array
    pair = camera.at_wavelength(620 * nm), camera.at_wavelength(640 * nm)
    change = camera.part_images([pair]).derivative(Points(place[None], np.ones(1)), np.ones(1))
    whole = camera.part_images([]).forward(Points(place[None], np.ones(1))).sum(dtype=float)
    assert abs(change.sum(dtype=float)) < 5e-3 * whole  # by samples of their own, 6e-2 of it
