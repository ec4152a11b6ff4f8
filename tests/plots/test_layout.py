"""Ray diagrams: the right distances in words, readable labels, and rays that meet where optics says."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Ellipse

from lumigraph.design.layout import GlassLayout, Layout
from lumigraph.errors import GeometryError
from lumigraph.instruments import load_camera
from lumigraph.plots.layout import layout
from lumigraph.plots.microscope_layout import planes, traced

NAMES = [
    "thesis-plenoptic-1",
    "thesis-plenoptic-2-m050",
    "thesis-plenoptic-2-m025",
    "galilean",
    "multi-focus-hex",
]
FAR = {"object_distance": "2 m"}


def camera_of(name):
    if name == "2.0":
        return load_camera("lfm-worm").replace(
            configuration="2.0", lenslet_offset="6 mm", sensor_distance="3 mm"
        )
    return load_camera("galilean").replace(**FAR) if name == "far" else load_camera(name)


def texts(figure):
    return [text for axes in figure.axes for text in axes.texts if text.get_text()]


SCOPES = ["lfm-guv", "lfm-worm", "lfm-fourier", "2.0"]


@pytest.mark.parametrize("name", [*NAMES, *SCOPES, "thesis-2f", "far"])
def test_no_label_covers_another(name):
    figure = layout(camera_of(name))
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts(figure)]
    for k, (one, box) in enumerate(boxes):
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1, one
        for other, its in boxes[k + 1 :]:
            assert not box.overlaps(its), (one, other)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("thesis-plenoptic-1", ["z1 = 240 mm", "F = z2 = 240 mm", "b = 10 mm", "D = 3.6 mm"]),
        (
            "thesis-plenoptic-2-m050",
            ["z1 = 120 mm", "L = 135.6 mm", "a = 15.6 mm", "b = 7.8 mm", "D = 2.308 mm"],
        ),
        ("galilean", ["a = -10.5 mm", "b = 2.625 mm", "virtual main-lens image"]),
        ("lfm-guv", ["objective\n60x / 1.2", "b = 2.5 mm", "native image\nand lenslets", "sensor"]),
        ("lfm-fourier", ["objective\n20x / 0.5", "tube lens\nf = 200 mm", "Fourier lens\nf = 75 mm"]),
        ("2.0", ["native image", "a = 6 mm", "b = 3 mm"]),
        ("thesis-2f", ["z1 = 316 mm", "z2 = 316 mm", "D = 5 mm", "sensor"]),
    ],
)
def test_distances_are_labelled(name, expected):
    found = [text.get_text() for text in texts(layout(camera_of(name)))]
    assert set(expected) <= set(found)


@pytest.mark.parametrize("name", ["thesis-plenoptic-2-m050", "galilean"])
def test_rays_through_one_lenslet_meet_on_the_sensor(name):
    camera = load_camera(name)
    rays = [line for line in layout(camera).axes[1].lines if len(line.get_xdata()) == 3]
    through = {}
    for line in rays:
        at_lenslets, at_sensor = (float(line.get_ydata()[k]) for k in (1, 2))
        through.setdefault(round(at_lenslets / (camera.lenslets.pitch * 1e3)), []).append(at_sensor)
    assert len(through) >= 3
    for lenslet, heights in through.items():
        # s = c (1 + m) for an image point on the axis
        expected = lenslet * camera.lenslets.pitch * 1e3 * (1 + camera.lenslet_magnification)
        assert heights == pytest.approx([expected] * len(heights), abs=1e-6)


def test_rays_of_one_place_on_the_main_lens_meet_on_one_pixel_of_the_plenoptic_camera():
    camera = load_camera("thesis-plenoptic-1")
    rays = [line for line in layout(camera).axes[1].lines if len(line.get_xdata()) == 3]
    ends = np.sort([line.get_ydata()[2] for line in rays])
    # The focal plane images infinity, not the main lens at 24 times that: a blur of p b/F = 6 um is left.
    assert len(rays) == 27
    assert np.count_nonzero(np.diff(ends) > 0.01) == 9 - 1


def test_a_camera_without_an_image_is_refused():
    class Near:
        def layout(self):
            return Layout(0.05, 0.06, 0.002, -0.3, 0.1, 0.01)

    with pytest.raises(
        GeometryError, match=r"the object at 50 mm is inside the focal length of 60 mm.* Move it"
    ):
        layout(Near())


@pytest.mark.parametrize("name", SCOPES)
def test_rays_of_a_microscope_meet_in_the_native_image_and_cross_in_the_pupil(name):
    drawn = camera_of(name).layout()
    stations = planes(drawn)
    heights = np.array([[traced(stations, y, u) for u in (-0.5, 0.0, 0.5)] for y in (0.0, 0.3)])
    names = [name for _, _, name in stations]
    image = next(k for k, name in enumerate(names) if name.startswith("native image"))
    assert heights[1, :, image] == pytest.approx([-2 * 0.3] * 3)
    assert heights[0, :, names.index("pupil")] == pytest.approx(heights[1, :, names.index("pupil")])
    if drawn.fourier_lens:  # the lenslets stand in the pupil's image
        assert heights[0, :, -1] == pytest.approx(heights[1, :, -1])


def test_micro_images_of_a_matched_microscope_touch():
    scope = load_camera("lfm-guv")
    (behind, lenslets) = scope.layout().behind, scope.layout().lenslets
    width = behind.pupil_diameter * lenslets.distance / behind.separation
    assert width == pytest.approx(scope.lenslets.pitch, rel=1e-3)


def test_each_kind_of_lenslets_has_its_colour_and_the_stronger_one_is_thicker():
    lower = layout(load_camera("multi-focus-hex")).axes[1]
    lenses = [patch for patch in lower.patches if isinstance(patch, Ellipse)]
    assert len({lens.get_facecolor() for lens in lenses}) == 3
    focal = load_camera("multi-focus-hex").layout().lenslets
    by_kind = {lens.get_width(): focal.focal_length(k - len(lenses) // 2) for k, lens in enumerate(lenses)}
    assert [by_kind[width] for width in sorted(by_kind)] == sorted(by_kind.values(), reverse=True)


def test_a_main_lens_of_glass_has_a_panel_to_scale():
    """Two pieces of glass, one on each side of the stop."""
    at = np.linspace(-5e-3, 5e-3, 11)
    surfaces = np.array([[np.full(11, z), at] for z in (0.0, 4e-3, 6e-3, 8e-3, 9e-3)])
    rays = np.zeros((6, 2, 7)) + np.array([-0.1, 0, 4e-3, 6e-3, 8e-3, 9e-3, 0.1])[:, None].T
    glass = GlassLayout(surfaces, (True, False, False, True, False), rays, 2, (3e-3, 5e-3))
    drawn = camera_of("thesis-plenoptic-1").layout()

    class Real:
        def layout(self):
            return replace(drawn, glass=glass)

    upper, middle, lower = layout(Real()).axes
    assert len(middle.patches) == 2
    assert middle.get_aspect() == 1.0
    assert {"H", "H\u2032", "stop"} <= {text.get_text() for text in middle.texts}
    assert glass.half_heights == pytest.approx([5e-3] * 5)
    assert upper.patches
    assert lower.patches
