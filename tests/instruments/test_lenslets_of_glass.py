"""Lenslets of glass in camera files: their colours, and what is refused."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import FocusedPlenopticCamera, GeometryError, PlenopticCamera
from lumigraph.elements.surface import GlassSurface, index_at


def camera(kind=PlenopticCamera, **lenslets):
    more = {"magnification": 0.5} if kind is FocusedPlenopticCamera else {}
    return kind(
        wavelength="550 nm", object_distance="200 mm", main_lens={"focal_length": "100 mm"},
        sensor={"pixel_pitch": "6 um"},
        lenslets={"pitch": "60 um", "focal_length": "600 um", "count": (5, 5), **more, **lenslets},
    )  # fmt: skip


@pytest.mark.parametrize("kind", [PlenopticCamera, FocusedPlenopticCamera])
def test_the_focal_length_follows_the_glass_and_nothing_else_moves(kind):
    known = camera(kind, index=1.5168, abbe=64.17)
    blue = known.at_wavelength(450e-9)
    n = [index_at(wavelength, 1.5168, 64.17) for wavelength in (550e-9, 450e-9)]
    assert blue.lenslets.focal_length[0] == pytest.approx(600e-6 * (n[0] - 1) / (n[1] - 1))
    for name in ("separation", "lenslet_distance", "pupil_diameter", "micro_image_pitch"):
        assert getattr(blue, name) == pytest.approx(getattr(known, name))
    assert blue.sensor.shape == known.sensor.shape
    assert blue.at_wavelength(550e-9).lenslets.focal_length[0] == pytest.approx(600e-6)
    plain = camera(kind, index=1.5168).at_wavelength(450e-9)
    assert plain.lenslets.focal_length == known.lenslets.focal_length
    assert not plain.built


def test_colours_of_pictures_and_of_operators_are_those_of_the_glass(monkeypatch, tmp_path):
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path))
    known = camera(FocusedPlenopticCamera, index=1.62, abbe=20.0, count=(3, 3))
    plain = known.replace(lenslets={"abbe": None})
    blue = lg.Spectrum((450e-9,), ((1.0,),))
    grid = lg.Grid.square(3, known.object_grid.pitch[0])
    scene = lg.Scene([lg.Slice(np.eye(3, dtype=np.float32), grid, 0.0)])
    images = []
    for one in (known, plain):
        operator = one.operator(samples_per_lenslet=3, accuracy=1e-2, spectrum=blue)
        plane = np.zeros(operator.shape[1], np.float32)
        plane[4, 4] = 1
        raw = lg.simulate(one, scene, lg.Incoherent(accuracy=1e-2), spectrum=blue).data
        images.append((operator.forward(plane), raw))
    own = known.at_wavelength(450e-9).operator(samples_per_lenslet=3, accuracy=1e-2)
    np.testing.assert_allclose(images[0][0], own.forward(plane), rtol=1e-5, atol=1e-9)
    for with_glass, without in zip(*images, strict=True):
        assert np.linalg.norm(with_glass - without) > 0.05 * np.linalg.norm(without)


def test_a_camera_describes_its_glass():
    known = camera(index=1.5168, abbe=64.17, conic=-0.5, thickness="500 um")
    assert known.optics().surface == GlassSurface(index_at(550e-9, 1.5168, 64.17), -0.5, 500e-6)
    text = str(known.describe())
    for part in ("lenslet Abbe number", "lenslet radius", "311.1", "K, given; faces the main lens"):
        assert part in text
    assert "lenslet radius" not in str(camera(index=1.5).describe())


@pytest.mark.parametrize(
    ("lenslets", "message"),
    [
        ({"conic": 0}, "conic needs the glass' index. Add it, such as index = 1.46"),
        ({"abbe": 60}, "abbe needs the glass' index"),
        ({"index": 1.5, "thickness": "1 mm"}, "thickness is of lenslets with a surface"),
        ({"index": 1.5, "conic": 101}, "conic is 101 but must be from -100 to 100"),
        ({"index": 1.5, "conic": float("nan")}, "conic"),
        ({"index": 1.5, "conic": 0, "focal_length": "100 um"}, "too steep for light to pass"),
        ({"index": 1.5, "conic": 0, "thickness": "1 mm"}, "to n f = 900 µm"),
    ],
)
def test_glass_that_cannot_be_is_refused(lenslets, message):
    with pytest.raises(GeometryError, match=message):
        camera(**lenslets)


def test_an_abbe_number_leaves_glass_at_every_wavelength():
    with pytest.raises(GeometryError, match=r"by abbe = 1 the index at 5000 nm is .* but it must be above 1"):
        camera(index=1.5, abbe=1.0).at_wavelength(5e-6)


def test_glass_ends_before_the_sensor():
    with pytest.raises(GeometryError, match=r"over their index is 533\.33 µm, but the sensor is only 500 µm"):
        camera(index=1.5, conic=0, thickness="800 um").replace(built={"lenslet_distance": "500 um"})


def test_microscopes_refuse_glass():
    microscope = lg.load_camera("lfm-guv")
    with pytest.raises(GeometryError, match=r"lenslets\.conic and lenslets\.abbe are of cameras"):
        microscope.replace(lenslets={"index": 1.5, "conic": 0})
