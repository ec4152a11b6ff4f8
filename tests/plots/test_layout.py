"""Ray diagrams: the right distances in words, readable labels, and rays that meet where optics says."""

import numpy as np
import pytest

from lumigraph.design.layout import Layout
from lumigraph.errors import GeometryError
from lumigraph.instruments import load_camera
from lumigraph.plots.layout import layout

NAMES = [
    "thesis-plenoptic-1",
    "thesis-plenoptic-2-m050",
    "thesis-plenoptic-2-m025",
    "galilean",
    "multi-focus-hex",
]
FAR = {"object_distance": "2 m"}


def camera_of(name):
    return load_camera("galilean").replace(**FAR) if name == "far" else load_camera(name)


def texts(figure):
    return [text for axes in figure.axes for text in axes.texts if text.get_text()]


@pytest.mark.parametrize("name", [*NAMES, "thesis-2f", "far"])
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
        ("thesis-2f", ["z1 = 316 mm", "z2 = 316 mm", "D = 5 mm", "sensor"]),
    ],
)
def test_distances_are_labelled(name, expected):
    found = [text.get_text() for text in texts(layout(load_camera(name)))]
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
