"""Layers of rendered scenes, beside what the renderer sees from other places of the main lens."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.errors import FormatError, GeometryError, SamplingWarning
from lumigraph.scene import raytraced

mitsuba = pytest.importorskip("mitsuba", reason="Mitsuba 3 is an extra: pip install 'lumigraph[scenes]'")

CAMERA = SimpleNamespace(object_distance=0.2, pupil_diameter=4e-3)
GRID = Grid((60, 80), 1e-4, (5e-4, -1e-3))


@pytest.fixture(scope="module", autouse=True)
def variant():
    mitsuba.set_variant("scalar_rgb")


def texture():
    noise = np.random.default_rng(0).random((64, 64, 3))
    smooth = gaussian_filter(noise, (3, 3, 0), mode="wrap")
    smooth = (smooth - smooth.min()) / np.ptp(smooth)
    return {"type": "bitmap", "raw": True, "bitmap": mitsuba.Bitmap(np.float32(0.1 + 0.8 * smooth))}


def card(y, x, z, height, width):
    place = mitsuba.ScalarTransform4f().translate([x, y, z]).rotate([1, 0, 0], 180)
    return {
        "type": "rectangle",
        "to_world": place.scale([width / 2, height / 2, 1]),
        "bsdf": {"type": "diffuse", "reflectance": texture()},
    }


def room(**parts):
    light = {"type": "constant"}
    wall = card(0, 0, 0.25, 0.03, 0.03)
    path = {"type": "path", "max_depth": 2}
    return {"type": "scene", "integrator": path, "light": light, "wall": wall, **parts}


@pytest.fixture(scope="module")
def cards():
    return room(near=card(5e-4, 1e-3, 0.16, 2e-3, 2e-3), middle=card(-2e-4, -2e-3, 0.2, 2.2e-3, 1.5e-3))


@pytest.fixture(scope="module")
def layers(cards):
    return lg.scene.mitsuba(cards, CAMERA, GRID, 24, samples=16, colour=True)


def seen_from(found, place):
    """What a place of the lens sees of slices, the farthest first."""
    picture = np.zeros((*GRID.shape, 3))
    for part in sorted(found.scene.parts, key=lambda one: -one.dz):
        size = 1 + part.dz / CAMERA.object_distance
        out = np.zeros((*GRID.shape, 4))
        both = np.concatenate([part.intensity, part.opacity[..., None]], -1)
        corner = []
        for axis, along in enumerate((part.grid.y, part.grid.x)):
            first = along[0] / size + place[axis] * (1 - 1 / size)
            corner.append((first - (GRID.y, GRID.x)[axis][0]) / GRID.pitch[axis])
        whole = [math.floor(one) for one in corner]
        moved = np.zeros((both.shape[0] + 1, both.shape[1] + 1, 4))
        moved[:-1, :-1] = both
        moved = shift(moved, (corner[0] - whole[0], corner[1] - whole[1], 0), order=1, mode="grid-constant")
        rows, columns = (
            slice(max(0, w), min(n, w + m)) for w, n, m in zip(whole, GRID.shape, moved.shape, strict=False)
        )
        out[rows, columns] = moved[
            rows.start - whole[0] : rows.stop - whole[0], columns.start - whole[1] : columns.stop - whole[1]
        ]
        picture = out[..., :3] + (1 - out[..., 3:]) * picture
    return picture


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.1e-3, -0.7e-3), (-0.3e-3, 1.7e-3)])
def test_places_of_the_lens_see_what_the_renderer_sees(layers, cards, place):
    (view,) = raytraced.Tracer.of(cards).views(GRID, CAMERA.object_distance, [place], 64, 9)
    true = view.light.reshape(60, 2, 80, 2, 3).mean((1, 3))
    found = seen_from(layers, place)
    inner = slice(2, -2)
    off = np.sqrt(np.mean((found - true)[inner, inner] ** 2) / np.mean(true**2))
    assert off < 0.036  # noise of the rays is 0.020


def test_truth_is_that_of_the_middle(layers):
    assert layers.depth[3, 3] == pytest.approx(0.05, abs=1e-5)
    near = 30 - 0 + round((5e-4 / 0.16 * 0.2 - GRID.center[0]) / 1e-4)
    across = 40 + round((1e-3 / 0.16 * 0.2 - GRID.center[1]) / 1e-4)
    assert layers.depth[near, across] == pytest.approx(-0.04, abs=1e-5)
    assert layers.normals[near, across] == pytest.approx([0, 0, -1], abs=1e-5)
    assert layers.visibility[near, across] == pytest.approx(1, abs=1e-5)
    width = 2e-3 / 0.16 * 0.2 / 1e-4
    beside = across + round(width / 2) + 1
    assert 0.4 < layers.visibility[near, beside] < 0.8  # half of the lens sees it, past the card
    assert layers.glossy < 0.005
    assert layers.noise < 0.03


def test_gloss_is_told():
    metal = {"type": "roughconductor", "alpha": 0.1}
    ball = {"type": "sphere", "center": [0, 0, 0.2], "radius": 2e-3, "bsdf": metal}
    lamp = {"type": "sphere", "center": [0.02, -0.02, 0.1], "radius": 6e-3,
            "emitter": {"type": "area", "radiance": 30.0}}  # fmt: skip
    wide = SimpleNamespace(object_distance=0.2, pupil_diameter=0.02)
    with pytest.warns(SamplingWarning, match=r"surfaces' light changes by [\d.]+ % rms over the main lens"):
        found = lg.scene.mitsuba(room(ball=ball, lamp=lamp), wide, Grid.square(40, 1e-4), samples=16)
    assert found.glossy > 0.02


def test_a_camera_stands_where_the_scenes_sensor_does(cards):
    turned = mitsuba.ScalarTransform4f().rotate([0, 1, 0], 40).translate([0.3, -0.1, 0.2])
    moved = {
        key: {**part, "to_world": turned @ part["to_world"]} if key in ("wall", "near", "middle") else part
        for key, part in cards.items()
    }
    level = mitsuba.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, -1, 0])
    moved["eye"] = {"type": "perspective", "to_world": turned @ level}
    plain, found = (lg.scene.mitsuba(one, CAMERA, GRID, 4, across=3) for one in (cards, moved))
    assert found.depth == pytest.approx(plain.depth, abs=1e-5)
    assert np.abs(found.radiance - plain.radiance).mean() < 0.05 * plain.radiance.mean()


def test_bad_scenes_end_in_one_line(cards, tmp_path):
    with pytest.raises(FormatError, match="is not there"):
        lg.scene.mitsuba(tmp_path / "none.xml", CAMERA, GRID)
    broken = tmp_path / "broken.xml"
    broken.write_text("<scene version='3.0.0'><shape")
    with pytest.raises(FormatError, match="Mitsuba cannot read"):
        lg.scene.mitsuba(broken, CAMERA, GRID)
    with pytest.raises(GeometryError, match="across is 4 but must be odd"):
        lg.scene.mitsuba(cards, CAMERA, GRID, across=4)
    open_scene = {"type": "scene", "light": {"type": "constant"}, "near": card(0, 0, 0.2, 1e-3, 1e-3)}
    with pytest.raises(GeometryError, match="of the light comes from nowhere"):
        lg.scene.mitsuba(open_scene, CAMERA, GRID)
    with pytest.raises(GeometryError, match="sees nothing"):
        lg.scene.mitsuba({"type": "scene", "light": {"type": "constant"}}, CAMERA, GRID)


def test_a_raw_image_shows_the_scene_from_a_file(tmp_path):
    file = tmp_path / "room.xml"
    file.write_text(
        """<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/>
        <scale value="0.01"/><translate z="0.2"/></transform></shape></scene>"""
    )
    camera = lg.PlenopticCamera.model_validate(
        {
            "wavelength": "550 nm",
            "object_distance": "200 mm",
            "main_lens": {"focal_length": "100 mm"},
            "lenslets": {"pitch": "100 um", "focal_length": "3.6 mm", "count": [5, 5]},
            "sensor": {"pixel_pitch": "20 um"},
        }
    )
    found = lg.scene.mitsuba(file, camera, planes=1, across=3, samples=64)
    (part,) = found.scene.parts
    even = lg.Scene([lg.Slice(np.full(part.grid.shape, 0.5, np.float32), part.grid)])
    raw, like = (lg.simulate(camera, one).data for one in (found.scene, even))
    middle = slice(5, 20)
    assert raw[middle, middle] == pytest.approx(like[middle, middle], rel=0.02)
