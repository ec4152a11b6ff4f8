"""The designer computes what the library computes, and refuses what no camera can be."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

import lumigraph as lg
from lumigraph import viewer
from lumigraph.errors import FormatError, GeometryError, LumigraphError, SamplingError
from lumigraph.viewer.designer import designed
from lumigraph.viewer.designer_curves import trade_offs

FOCUSED = lg.load_camera("thesis-plenoptic-2-m050")


@pytest.mark.parametrize("name", lg.catalogue())
def test_the_parameters_of_every_camera_give_that_camera_back(name):
    camera = lg.load_camera(name)
    values = {each.key: each.value for each in camera.parameters()}
    assert camera.changed(values) == camera
    for each in camera.parameters():
        if each.kind != "choice" and each.value is not None:
            assert each.low <= each.value <= each.high, each.key


def test_a_slider_changes_one_value_and_the_file_says_so():
    camera = FOCUSED.changed({"lenslets.pitch": 120.0, "lenslets.count.0": 21, "main_lens.diameter": 2.0})
    assert camera.lenslets.pitch == pytest.approx(120e-6)
    assert camera.lenslets.count == (21, FOCUSED.lenslets.count[1])
    assert camera.main_lens.diameter == pytest.approx(2e-3)
    answer = viewer.designer_site(FOCUSED, "f").calls["design"]({"values": {"lenslets.pitch": 120.0}})
    assert 'pitch = "120 um"' in answer["toml"]
    matched = camera.changed({"main_lens.diameter": None})
    assert matched.pupil_diameter == pytest.approx(matched.intended_diameter)


@pytest.mark.parametrize(
    ("values", "error", "said"),
    [
        ({"sensor.bits": 8}, FormatError, "is not a parameter of this camera"),
        ({"lenslets.pitch": "wide"}, FormatError, "must be a finite number"),
        ({"lenslets.pitch": float("nan")}, FormatError, "must be a finite number"),
        ({"lenslets.pitch": 10**400}, FormatError, "must be a finite number"),
        pytest.param({"lenslets.count.0": 10**5000}, FormatError, "must be a finite number", id="long"),
        ({"lenslets.count.0": 1000}, FormatError, "must be a whole number from 1 to 301"),
        ({"matching": "none"}, FormatError, "must be views or full or touching"),
        ({"object_distance": 50.0}, GeometryError, "inside the main lens' focal length"),
        ([1], FormatError, "values must be numbers by their keys"),
    ],
)
def test_values_that_cannot_be_are_refused_in_one_line(values, error, said):
    with pytest.raises(error, match=said):
        FOCUSED.changed(values)


def test_depths_that_cannot_be_are_refused():
    calls = viewer.designer_site(FOCUSED, "f").calls
    with pytest.raises(FormatError, match="dz is 'far' but must be a finite number"):
        calls["point"]({"values": {}, "dz": "far"})
    with pytest.raises(GeometryError, match="beyond 100000 m"):
        calls["point"]({"values": {}, "dz": 1e9})
    with pytest.raises(LumigraphError, match="inside its focal length"):
        calls["point"]({"values": {}, "dz": -0.1})
    with pytest.raises(SamplingError, match="samples"):
        FOCUSED.replace(main_lens={"diameter": 0.02}).point_view()


def test_curves_pass_through_the_camera_and_follow_the_closed_forms():
    found = trade_offs(FOCUSED)
    curves = {curve["name"]: curve for curve in found["curves"]}
    assert len(curves) == 6
    assert curves["Views per axis"]["here"] == pytest.approx(2.0)  # 1/m
    for curve in curves.values():
        between = np.interp(np.log(0.5), np.log(found["positions"]), np.log(curve["values"]))
        assert np.exp(between) == pytest.approx(curve["here"], rel=0.02)  # between two of 41 positions
    table = FOCUSED.describe().as_dict()
    assert curves["Picture cut-off at the object"]["here"] * 1e3 == pytest.approx(
        table["rendered cut-off at the object"]
    )
    assert curves["Depth of field"]["here"] / 1e3 == pytest.approx(table["depth of field"])


@pytest.mark.parametrize("name", lg.catalogue())
def test_the_table_and_the_curves_of_a_page_say_the_same(name):
    """A camera 1.0 had 31.25 views per axis in its table, its pixels, and 2.91 in its curve."""
    camera = lg.load_camera(name)
    page = designed(camera)
    table = {row[0]: row[1:] for section in page["sections"] for row in section["rows"]}
    assert page["curves"]["curves"]
    for curve in page["curves"]["curves"]:
        text, equation = table[curve["name"][0].lower() + curve["name"][1:]]
        told = f"{curve['here']:.5g} {curve['unit']}".strip()
        assert (text, equation) == (told, curve["equation"])
    names = [row.name for row in camera.quantities()]
    assert len(names) == len(set(names))


def test_views_of_a_camera_1_are_no_more_than_diffraction_leaves():
    known = lg.load_camera("thesis-plenoptic-1").describe().as_dict()
    assert known["pixels per micro-image"] == pytest.approx(31.25)
    assert known["views per axis"] == known["resolvable directions"] == pytest.approx(2.914, abs=1e-3)


def test_the_axial_resolution_of_a_plenoptic_1_moves_the_outermost_views_by_one_lenslet():
    camera = lg.load_camera("thesis-plenoptic-1")
    (axial,) = (c["here"] * 1e-3 for c in trade_offs(camera)["curves"] if c["name"] == "Axial resolution")
    shift = camera.pupil_diameter * abs(1 - camera.alpha(axial)) / camera.lenslets.pitch
    assert shift == pytest.approx(1, rel=0.05)  # first order in dz/z1 = 0.04


def test_the_image_of_a_point_is_that_of_simulate():
    camera = FOCUSED.replace(lenslets={"count": (11, 11)})
    found = FOCUSED.point_view(5e-3)
    whole = lg.simulate(camera, lg.targets.points([(0.0, 0.0, 5e-3)])).data
    cut = [slice((n - m) // 2, (n - m) // 2 + m) for n, m in zip(whole.shape, found.data.shape, strict=True)]
    # What the few lenslets that are left out would have sent there is below a hundredth of the brightest.
    assert np.abs(found.data - whole[cut[0], cut[1]]).max() < 0.01 * whole.max()
    answer = viewer.designer_site(FOCUSED, "f").calls["point"]({"values": {}, "dz": 5e-3})
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(answer["png"].split(",")[1]))))
    wanted = 255 * np.sqrt(np.maximum(found.data, 0) / found.data.max())
    assert np.abs(pixels - wanted).max() <= 0.51


def test_a_microscope_and_a_single_lens_have_designers_too():
    for name in ("lfm-guv-simulated", "lfm-fourier"):
        calls = viewer.designer_site(lg.load_camera(name), name).calls
        assert calls["design"]({"values": {"wavelength": 600.0}})["curves"]["curves"]
        assert "<svg" in calls["layout"]({"values": {}})["svg"]
    assert len(trade_offs(lg.load_camera("thesis-2f"))["curves"]) == 3
