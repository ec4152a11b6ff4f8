"""Main lenses from prescriptions: terms from rays of lenses that are known in closed form."""

import math
import sys
from contextlib import contextmanager

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.elements import noll_to_nm
from lumigraph.errors import FormatError, GeometryError, LumigraphError, ParaxialWarning
from lumigraph.instruments import glass
from lumigraph.io.prescription import FirstOrder, Rays
from lumigraph.operators.lenslets.point_light import point_light
from lumigraph.operators.lenslets.points import points_image as lens_points
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.glass_distortion import distorted, seen_points
from lumigraph.operators.single_lens import points_image, single_lens_operator

F, Z1, D = 0.1, 1.0, 0.01
Z2 = 1 / (1 / F - 1 / Z1)
EXIT = -0.025
"""Of the exit pupil: m_p = 1 - EXIT / F = 1.25."""
TURN, SHRINK, BARREL, LEAN = Z2 / (Z2 - EXIT), 8.0, -4.0, -6.0
"""Chief rays' slope by the image's height over z2; by the field's square, less stop, distortion and slope."""


class Lens:
    """Of known phases: a ray of direction d arrives where ∇(Φ + d·w) = 0, with the path Φ + d·w there."""

    def __init__(self, path):
        self.name, self.notes = "known.zmx", ("a note",)

    def wavelengths(self):
        return 4e-7, 8e-7

    def first_order(self, wavelength):
        return FirstOrder(F, 0.01, -0.02, EXIT, 1.25, 0.02)

    def focus(self, object_distance, image_distance, diameter):
        self.pupil = diameter

    def trace(self, wavelength, heights, pupil):
        field = heights[:, None] / Z1
        half = D / 2 / Z2 * (1 + 0.1 * (wavelength / 550e-9 - 1))  # wider in red
        chief = -field * (TURN + LEAN * field**2)
        along = chief - half * (1 - SHRINK * field**2) * pupil[:, 0]
        across = -half * np.ones_like(field) * pupil[:, 1]
        u, v = (chief - along) / (D / 2 / Z2), -across / (D / 2 / Z2)  # places of the thin lens' stop
        coma, bent, ball = 2e-6 * field, 20e-6 * field**2, 1e-7
        r = u**2 + v**2
        path = coma * r * u + bent * r + ball * r**2
        slope = (coma * (3 * u**2 + v**2) + 2 * bent * u + 4 * ball * r * u,
                 coma * 2 * u * v + 2 * bent * v + 4 * ball * r * v)  # fmt: skip
        y, x = (part / (D / 2 / Z2) for part in slope)  # -∂Φ/∂l, as u falls with l
        place = -field * Z2 * (1 + BARREL * field**2) + y
        return Rays(along, across, place, x, path + 1.0 + along * y + across * x)


@contextmanager
def known_lenses():
    """Every prescription is `Lens` inside of it; nothing of that is remembered before or after."""
    forget()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LUMIGRAPH_CACHE", "off")
        patch.setattr(glass, "Prescription", Lens)
        yield
    forget()


def forget():
    glass._glass.cache_clear()
    glass._first_order.cache_clear()


@pytest.fixture
def known():
    with known_lenses():
        yield


def single(path, **lens):
    return lg.SingleLensCamera(
        wavelength="550 nm", object_distance=Z1,
        main_lens={"focal_length": F, "diameter": D, "prescription": path, **lens},
        sensor={"pixel_pitch": "5 um", "shape": (2001, 2001)},
    )  # fmt: skip


@pytest.fixture
def camera(known, tmp_path):
    path = tmp_path / "known.zmx"
    path.write_text("not read")
    return single(path)


def test_terms_are_those_of_the_wavefront(camera):
    """Coma and field curvature, over the stop as each field sees it; what focus takes away is not in them."""
    found, field = camera.glass, 0.05
    assert found.rms(0.0, 550e-9) == pytest.approx(1e-7 / (6 * math.sqrt(5)) / 550e-9, rel=1e-3)
    waves, (a, b) = found.aberrations.at(0.0, field, 550e-9), found.openings.at(field, 550e-9)
    assert (a, b) == pytest.approx((1 - SHRINK * field**2, 1.0), abs=1e-6)
    y, x = np.meshgrid(np.linspace(-1, 1, 301), np.linspace(-1, 1, 301), indexing="ij")
    rho, theta = np.hypot(y, x), np.arctan2(y, x)
    inside = rho <= 1
    told = sum(c * lg.elements.zernike(j, rho, theta) for j, c in waves.items())[inside]
    u, v = a * x[inside], b * y[inside]
    focus = -1e-7  # the axis' own, of the mean over the stop: 6 ρ⁴ - 6 ρ² is Z11's
    r = u**2 + v**2
    path = 2e-6 * field * r * u + (20e-6 * field**2 + focus) * r + 1e-7 * r**2
    off = told - path / 550e-9
    assert np.std(off) < 2e-3
    assert np.std(told) > 0.05


def test_the_image_moves_and_the_pupil_turns_as_chief_rays_do(camera):
    found, at = camera.glass, np.array(camera.glass.aberrations.x)
    slopes = np.tan(np.arcsin(at * (TURN + LEAN * at**2)))
    refocused = found.defocus * slopes  # chief rays go on to another plane
    assert found.moved == pytest.approx(BARREL * at**3 * Z2 + refocused, abs=1e-9)
    assert found.turned == pytest.approx(slopes - at, rel=1e-6, abs=1e-9)
    text = str(camera.describe())
    assert "known.zmx" in text
    assert "a note." in text
    assert "exit pupil to lenslets" in text
    with pytest.warns(ParaxialWarning, match="a note"):
        camera.optics()


def centroid(raw):
    """Of a raw image (y, x) [m] from the middle."""
    y, x = (np.arange(n) - n // 2 for n in raw.shape)
    return np.array([raw.sum(1) @ y, raw.sum(0) @ x], float) / raw.sum() * 20e-6


@pytest.mark.parametrize("dz", [0.0, pytest.param(0.3, marks=pytest.mark.long)])
def test_a_point_stands_where_its_chief_ray_arrives(camera, dz):
    """Distorted, and as seen from the entrance pupil, 20 mm before the lens; rays of coma have a mean."""
    coarse = camera.replace(sensor={"pixel_pitch": "20 um", "shape": (21, 501)})
    field, entrance = 0.036, EXIT / 1.25
    x = field * (Z1 + dz + entrance) * Z1 / (Z1 + entrance)
    raw, _ = points_image(coarse, lg.Points(np.array([[0.0, x, dz]]), np.ones(1)))
    height = field * Z2 * (1 + BARREL * field**2) + coarse.glass.defocus * field * TURN
    coma = -2e-6 * field / (D / 2 / Z2)
    assert centroid(raw)[1] == pytest.approx(
        height + coma, abs=2e-6
    )  # distortion is 21 µm, the other pupil 37


def test_samples_of_a_slice_go_where_points_do(camera):
    space = camera.traced.objects
    grid = lg.Grid((7, 9), 20e-6, (0.01, 0.04))
    onto, seen = distorted(space, grid, camera.exit_pupil.object_distance, 15e-6)
    picture, raw = np.random.default_rng(1).random(grid.shape), np.random.default_rng(2).random(onto.shape[0])
    assert np.vdot(onto.forward(picture), raw) == pytest.approx(np.vdot(picture, onto.adjoint(raw)), rel=1e-6)
    area = (1.25 * 20e-6 / 15e-6) ** 2  # samples are intensities
    assert onto.forward(picture).sum() == pytest.approx(area * picture.sum(), rel=1e-4)
    one = np.zeros(grid.shape)
    one[5, 2] = 1
    image = onto.forward(one) / area
    point = lg.Points(np.array([[grid.y[5], grid.x[2], 0.0]]), np.ones(1))
    (expected,) = seen_points(camera.optics(), point)[1].positions
    assert image.sum(1) @ seen.y == pytest.approx(expected[0], abs=3e-7)  # of samples 15 µm apart
    assert image.sum(0) @ seen.x == pytest.approx(expected[1], abs=3e-7)
    assert abs(expected[1] - 1.25 * grid.x[2]) > 1e-4


def test_a_slice_behind_glass_is_the_sum_of_its_points(camera):
    strip = camera.replace(sensor={"pixel_pitch": "20 um", "shape": (9, 41)})
    optics, grid = strip.optics(), lg.Grid((3, 4), 20e-6, (0.0, 0.003))
    operator = single_lens_operator(optics, grid, 0.0, 1e-2)
    picture = np.random.default_rng(1).random(grid.shape)
    y, x = (part.ravel() for part in np.meshgrid(grid.y, grid.x, indexing="ij"))
    share = picture.ravel() * (20e-6 * 1.25 / optics.object_pitch) ** 2
    expected, _ = points_image(strip, lg.Points(np.stack([y, x, 0 * x], axis=1), share))
    found = operator.forward(picture)
    assert np.linalg.norm(found - expected) < 1e-3 * np.linalg.norm(expected)
    raw = np.random.default_rng(2).random(operator.shape[0])
    assert np.vdot(found, raw) == pytest.approx(np.vdot(picture, operator.adjoint(raw)), rel=1e-6)


def plenoptic_behind(path):
    return lg.PlenopticCamera(
        wavelength="550 nm", object_distance=Z1,
        main_lens={"focal_length": F, "diameter": D, "prescription": path},
        lenslets={"pitch": "240 um", "focal_length": "2.6 mm", "count": (31, 31)},
        sensor={"pixel_pitch": "12 um"},
    )  # fmt: skip


@pytest.fixture
def plenoptic(camera):
    return plenoptic_behind(camera.main_lens.prescription)


@pytest.fixture(scope="module")
def whole_strip(tmp_path_factory):
    path = tmp_path_factory.mktemp("glass") / "known.zmx"
    path.write_text("not read")
    with known_lenses():
        camera = plenoptic_behind(path).replace(lenslets={"count": (5, 31)})
        return camera, lg.simulate(camera, lg.targets.white(), lg.Incoherent(1e-2))


@pytest.fixture
def strip(whole_strip, known):
    """Five rows of lenslets across the whole field, and their white image."""
    return whole_strip


@pytest.mark.long
def test_points_before_glass_have_derivatives_by_its_parts(camera):
    """Each camera's thin lens sees them elsewhere."""

    def plenoptic(distance):
        return lg.FocusedPlenopticCamera(
            wavelength="550 nm", object_distance=distance,
            main_lens={"focal_length": F, "diameter": D, "prescription": camera.main_lens.prescription},
            lenslets={"pitch": 200e-6, "focal_length": 2e-3, "count": (7, 7), "magnification": 0.3},
            sensor={"pixel_pitch": "6 um", "shape": (240, 240)},
        )  # fmt: skip

    point = lg.Points(np.array([[0.9e-3, -1.3e-3, -5e-3]]), np.ones(1))
    pairs = [tuple(plenoptic(Z1 * (1 + s)) for s in (-step, step)) for step in (1e-6, 2e-6)]
    images = plenoptic(Z1).part_images([pairs[0]])
    both = images.forward(point), lens_points(plenoptic(Z1), point, 2e-3)
    low, high = (end.part_images([]).forward(point) for end in pairs[1])
    changes = 2 * images.derivative(point, np.ones(1)), high - low
    for (found, expected), most in ((both, 1e-2), (changes, 1e-3)):
        assert np.linalg.norm(found - expected) < most * np.linalg.norm(expected)


def test_micro_images_stand_where_chief_rays_have_them(strip):
    """In a white image by its own calibration: pitch of the exit pupil, and each centre by its own slope."""
    plenoptic, white = strip
    found, own = lg.calibrate(white), plenoptic.calibration
    assert own.lattice.pitch == pytest.approx(20 * (1 + 2.6e-3 / (Z2 - EXIT)), rel=1e-9)
    assert plenoptic.micro_image_pitch == pytest.approx(own.lattice.pitch * 12e-6)
    assert found.lattice.pitch == pytest.approx(own.lattice.pitch, rel=2e-4)
    assert abs(20 * (1 + 2.6e-3 / Z2) / found.lattice.pitch - 1) > 3e-3


def test_a_white_image_darkens_as_the_stop_narrows(strip):
    plenoptic, white = strip[0], np.asarray(strip[1].data)
    pitch, (n, m) = plenoptic.calibration.lattice.pitch, (size // 2 for size in white.shape)
    across, box = round(13 * pitch), round(1.5 * pitch)
    middle, side = (white[n - box : n + box, k - box : k + box].mean() for k in (m, m + across))
    field = 13 * 240e-6 / Z2
    assert side / middle == pytest.approx(1 - SHRINK * field**2, abs=8e-4)


def test_its_stop_is_wider_where_its_rays_are(camera):
    assert camera.glass.openings.at(0.0, 605e-9) == pytest.approx((1.01, 1.01), rel=1e-6)
    assert camera.glass.rim < 1e-6


def test_the_entrance_pupil_has_the_aperture_of_the_thin_lens(camera):
    m = Z2 / Z1
    assert camera.glass.entrance_pupil == pytest.approx(D * (1.25 + m) / (1.25 * (1 + m)))


def test_a_point_farther_out_is_imaged_by_an_ellipse(camera):
    """It gets less light, by the area of its stop; within the window, which some light leaves."""
    seen = np.interp(0.06, camera.glass.aberrations.x, camera.traced.fields)
    one = field_lenses.at(camera.optics(), 0.0, seen)
    plate = one.lens.elements[0]
    assert plate.area == pytest.approx(1 - SHRINK * 0.06**2, rel=1e-4)
    sums = []
    for part in (one, field_lenses.at(camera.optics(), 0.0, 0.0)):
        span = lg.Grid.square(128, 2e-6)
        light = point_light(part, part.object_distance, 2e-4)
        sums.append(float((np.abs(light.at(span.y, span.x)) ** 2).sum()))
    assert sums[0] / sums[1] == pytest.approx(1 - SHRINK * 0.06**2, rel=3e-3)


def test_a_prescription_without_focal_length_names_the_remedy(tmp_path):
    with pytest.raises(
        FormatError, match=r"focal_length is missing beside prescription. Write the lens' own"
    ):
        lg.SingleLensCamera(
            object_distance=Z1, wavelength="550 nm", main_lens={"prescription": tmp_path / "lens.zmx"},
            sensor={"pixel_pitch": "5 um", "shape": (101, 101)},
        )  # fmt: skip


@pytest.mark.parametrize("dz", [-0.1, 0.0, 0.2])
def test_a_refocus_factor_has_the_depth_that_the_glass_gives_it(plenoptic, dz):
    """By the thin lens of the same focal length: -10 and 16 mm."""
    from lumigraph.viewer.opening import _metres

    aperture = lg.Grid.square(9, 1e-3)
    views = lg.LightField(np.zeros((9, 9, 1, 1)), aperture, lg.Grid((1, 1), 125e-6), plenoptic.pupil_distance)
    alpha = lg.DepthMap(np.array([[plenoptic.alpha(dz)]]), np.ones((1, 1)), "alpha")
    assert plenoptic.in_metres(alpha, views).values.item() == pytest.approx(dz, rel=1e-6, abs=1e-9)
    shown = _metres(plenoptic, views)
    assert shown is not None
    disparity = lg.depth.disparity_of(alpha, views).values
    assert shown(disparity).item() == pytest.approx(dz, rel=1e-4, abs=1e-6)


def test_perspective_has_its_centre_in_the_entrance_pupil(plenoptic):
    """Which stands at e'/m behind the front principal plane."""
    assert plenoptic.object_to_pupil() == pytest.approx(Z1 + EXIT / 1.25)


def test_in_other_light_glass_stays_where_its_own_brings_it_to_focus(camera):
    other = camera.at_wavelength(700e-9)
    assert other.wavelength == 700e-9
    assert (other.glass, other.exit_pupil) == (camera.glass, camera.exit_pupil)
    assert camera.replace(wavelength=700e-9).glass is not camera.glass  # focused anew


def test_simulated_points_take_it(camera):
    small = camera.replace(sensor={"shape": (101, 101)})
    raw = lg.simulate(small, lg.targets.points([(0.0, 0.0)]))
    assert np.unravel_index(np.argmax(raw.data), raw.data.shape) == (50, 50)


def test_terms_are_terms_of_a_round_lens():
    assert all(noll_to_nm(j)[1] >= 0 for j in glass.TERMS)
    assert glass.TERMS[:5] == (2, 4, 6, 8, 10)


@pytest.mark.parametrize(
    ("lens", "match"),
    [
        ({"focal_length": 0.102}, r"focal_length is 102 mm but .*known.zmx' has 100 mm at 550 nm"),
        ({"diameter": 0.03}, "opens to .* Use a smaller diameter"),
    ],
)
def test_what_contradicts_the_camera_is_refused(camera, lens, match):
    with pytest.raises(GeometryError, match=match):
        _ = camera.replace(main_lens=lens).glass


def test_light_that_is_cut_off_is_refused(camera, monkeypatch):
    whole = Lens.trace

    def cut(self, wavelength, heights, pupil):
        rays = whole(self, wavelength, heights, pupil)
        rays.path[heights > 0.03, -1] = np.nan
        return rays

    monkeypatch.setattr(Lens, "trace", cut)
    with pytest.raises(GeometryError, match=r"end at an aperture.* whole to 1\.\d+ degrees"):
        _ = camera.glass


def test_a_wavelength_that_no_glass_knows_is_refused(camera):
    with pytest.raises(GeometryError, match=r"glasses of 'known\.zmx' are known from 400 to 800 nm"):
        _ = camera.replace(wavelength="900 nm").glass


def test_a_camera_file_names_it_from_where_it_stands(tmp_path):
    (tmp_path / "lens.zmx").write_text("MODE SEQ")
    text = single("lens.zmx").to_toml()
    assert 'prescription = "lens.zmx"' in text
    (tmp_path / "camera.toml").write_text(text)
    camera = lg.load_camera(tmp_path / "camera.toml")
    assert camera.main_lens.prescription == tmp_path / "lens.zmx"
    assert type(camera).from_table(lg.io.source.toml("-", camera.to_toml())) == camera


@pytest.mark.parametrize(
    ("value", "others", "match"),
    [
        (3, {}, "main_lens.prescription: 3 is not the name of a file"),
        (
            "a.zmx",
            {"over_field": {"field": [0, 0.1], "unit": "waves", "terms": {8: [0, 1]}}},
            "Leave one out",
        ),
    ],
)
def test_what_is_no_prescription_is_one_line(value, others, match):
    with pytest.raises(FormatError, match=match):
        single(value, **others)


def test_without_optiland_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("LUMIGRAPH_CACHE", "off")
    monkeypatch.setitem(sys.modules, "optiland", None)
    path = tmp_path / "lens.zmx"
    path.write_text("MODE SEQ\n")
    with pytest.raises(LumigraphError, match=r"pip install 'lumigraph\[optiland\]'"):
        _ = single(path).glass


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ("UNIT IN X W X CM", "is in IN. Save it in mm"),
        ("MNUM 3 1", "has 3 configurations, which is not followed"),
        ("SURF 0\n  TYPE COORDBRK", "a surface 0 of type COORDBRK"),
        ("SURF 0\n  TYPE BICONICX", "a surface 0 of type BICONICX"),
        ("SURF 0\nSURF 1\n  GLAS MIRROR 0 0", "a mirror at surface 1"),
        ("SURF 0\n  OBDC 0 1.5", "OBDC at surface 0"),
        ("SURF 0\n  SQAP 1 1", "SQAP at surface 0"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_what_its_reader_passes_over_is_refused(tmp_path, line, match, encoding):
    path = tmp_path / "lens.zmx"
    path.write_text(f"MODE SEQ\n{line}\n", encoding=encoding)
    with pytest.raises((FormatError, GeometryError), match=match):
        _ = single(path).glass


def test_other_files_are_refused(tmp_path):
    with pytest.raises(FormatError, match="cannot be read"):
        _ = single(tmp_path / "none.zmx").glass
    (tmp_path / "lens.txt").write_text("x")
    with pytest.raises(FormatError, match="is no prescription"):
        _ = single(tmp_path / "lens.txt").glass


@pytest.mark.long  # an operator for the field's side, and light through each of its lenslets
def test_a_slice_of_a_plenoptic_camera_is_the_sum_of_its_points(plenoptic):
    """At the side of the field, where the thin lens on the axis has it elsewhere."""
    lenslets = {"pitch": "50 um", "focal_length": "0.54 mm", "count": (3, 9)}
    one = plenoptic.replace(lenslets=lenslets, sensor={"pixel_pitch": "5 um", "shape": None})
    grid, picture = lg.Grid((2, 3), 60e-6, (0.0003, -0.0015)), np.random.default_rng(1).random((2, 3))
    y, x = (part.ravel() for part in np.meshgrid(grid.y, grid.x, indexing="ij"))
    share = picture.ravel() * (60e-6 * 1.25 / one.optics().object_pitch) ** 2
    points = lg.Points(np.stack([y, x, 0 * x], axis=1), share)
    found, expected, thin = (
        lg.simulate(camera, lg.Scene([part]), lg.Incoherent(1e-2)).data
        for camera, part in (
            (one, lg.Slice(picture, grid)), (one, points),
            (one.replace(main_lens={"prescription": None}), lg.Slice(picture, grid)),
        )
    )  # fmt: skip
    assert np.linalg.norm(found - expected) < 5e-3 * np.linalg.norm(expected)
    assert np.linalg.norm(thin - expected) > 2e-2 * np.linalg.norm(expected)


@pytest.mark.long  # a white image of 25 lenslets, 20 px each
@pytest.mark.filterwarnings("ignore:an accuracy of 0.01 was asked for")  # one row of lenslets states more
def test_micro_images_move_where_chief_rays_are_less_steep(plenoptic, monkeypatch):
    """Inwards at the side of the field, by the slope's difference from the exit pupil's middle times b."""
    here = sys.modules[__name__]
    monkeypatch.setattr(here, "LEAN", -200.0)
    monkeypatch.setattr(here, "D", 0.005)  # gaps between micro-images
    glass._glass.cache_clear()
    one = plenoptic.replace(main_lens={"diameter": 0.005}, lenslets={"count": (1, 25)})
    white = np.asarray(lg.simulate(one, lg.targets.white(), lg.Incoherent(1e-2)).data)
    lattice, b = one.calibration.lattice, 2.6e-3
    for j in (-12, 12):
        y, x = np.rint(lattice.position(np.array([0, j]))).astype(int)
        part = white[y - 9 : y + 10, x - 9 : x + 10]
        moved = part.sum(0) @ (x + np.arange(-9, 10)) / part.sum() - lattice.position(np.array([0, j]))[1]
        height = -j * 240e-6
        field = height / Z2
        lean = field**3 * (-200 - TURN * BARREL)  # of an object at +field; its image is on the other side
        assert moved * 12e-6 == pytest.approx(-lean * b, rel=0.1)
        assert abs(moved) > 0.5
