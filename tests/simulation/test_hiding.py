"""What hides what: opaque slices against sums over points, each with its own wave past a knife edge."""

import numpy as np
import pytest
from benchmarks import hiding
from benchmarks.references import Fineness

import cameras
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.instruments import SingleLensCamera
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import Coherent, Incoherent, Snapshots, simulate
from lumigraph.units import mm, nm, um

QUICK = Fineness(lenslet=24, pixel=2, pupil=200)
SMALL = {"count": (3, 3), "pixel_pitch": 10 * um}
LIGHT = Incoherent(accuracy=1e-2)


def relative(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)


def wall(dz, x=(-3 * mm, 3 * mm)):
    """A dark sheet as high as the field."""
    return hiding.sheet((120 * mm + dz, *x), 120 * mm)


@pytest.mark.parametrize("nearer", [10 * mm, 40 * mm])
def test_a_chart_behind_a_knife_edge_is_the_sum_of_its_points_waves(nearer):
    """To 1 %; without diffraction at the edge it is off by 11 % and 23 %."""
    camera = cameras.focused(**SMALL)
    part, strip = hiding.chart(camera, 0.0, 6, 2), (120 * mm - nearer, 0.0, 10 * mm)
    expected = hiding.brute_force(camera, part, [strip], QUICK, looks=1)
    raw = simulate(camera, Scene([part, hiding.sheet(strip, 120 * mm)]), LIGHT)
    assert relative(raw.data, expected) < 1e-2
    assert raw.metadata["error"]["rms"] < 1.2e-2
    assert "hidden in part" in raw.metadata["error"]["source"]


@pytest.mark.parametrize(("pitch", "samples", "bars", "looks"), [(11.5 * um, 10, 4, 4), (4 * um, 16, 6, 1)])
def test_what_an_edge_close_before_a_chart_lets_pass_is_right_to_one_percent(pitch, samples, bars, looks):
    """Of 7 %: band-limited points behind the edge are off by 2 % to 3 %, samples taken for points by 1 %."""
    camera, low = cameras.focused(**SMALL), -samples * pitch / 2
    part, strip = hiding.chart(camera, 5 * mm, samples, bars, pitch), (120 * mm, low, 10 * mm)
    expected = hiding.brute_force(camera, part, [strip], QUICK, looks)
    raw = simulate(camera, Scene([part, hiding.sheet(strip, 120 * mm)]), LIGHT)
    assert relative(raw.data, expected) < 6e-3


@pytest.mark.parametrize("shape", [{}, {"layout": "hex", "shape": "round"}])
def test_points_look_past_edges_before_lenslets_of_any_shape(shape):
    camera = cameras.focused(**SMALL, **shape)
    places = [(0.0, 5 * um, 5 * mm), (20 * um, -60 * um, 5 * mm)][: 1 if shape else 2]
    strip = (110 * mm, 0.0, 10 * mm)
    expected = sum(
        hiding.Bench(camera, 5 * mm, [strip], QUICK).image([place[:2]], [1.0], camera.object_grid.pitch[0])
        for place in places
    )
    scene = targets.points(places)
    raw = simulate(camera, scene + Scene([hiding.sheet(strip, 120 * mm)]), LIGHT)
    assert relative(raw.data, expected) < 1e-2


def test_only_what_is_farther_is_hidden():
    camera = cameras.focused(**SMALL)
    part = hiding.chart(camera, 0.0, 8, 2)
    free = simulate(camera, Scene([part]), LIGHT).data
    before, behind = (simulate(camera, Scene([part, wall(dz)]), LIGHT).data for dz in (-20 * mm, 20 * mm))
    assert before.max() < 1e-3 * free.max()
    np.testing.assert_allclose(behind, free, atol=1e-6 * free.max())
    aside = simulate(camera, Scene([part, wall(-20 * mm, x=(5 * mm, 6 * mm))]), LIGHT).data
    np.testing.assert_allclose(aside, free, atol=1e-6 * free.max())


def test_points_that_nothing_hides_are_as_they_were():
    camera = cameras.focused(**SMALL)
    scene = targets.points([(10 * um, 20 * um, 0.0)])
    free = simulate(camera, scene, LIGHT).data
    for dz, tolerance in ((5 * mm, 1e-6), (-5 * mm, 1e-2)):  # beside a screen they have their own waves
        beside = simulate(camera, scene + Scene([wall(dz, x=(5 * mm, 6 * mm))]), LIGHT).data
        assert relative(beside, free) < tolerance


def test_what_hides_turns_with_the_camera():
    """Lenslets turned by 90° are the same lenslets; a screen that is not turned with them is off by 50 %."""
    images = []
    for rotation in (0.0, np.pi / 2):
        camera = cameras.focused(**SMALL, rotation=rotation)
        part = hiding.chart(camera, 0.0, 8, 2)
        covers = np.zeros((40, 40))
        covers[12:, 18:] = 1
        screen = Slice(np.zeros((40, 40)), Grid.square(40, 40 * um), -20 * mm, covers)
        images.append(simulate(camera, Scene([part, screen]), LIGHT).data)
    assert relative(images[1], images[0]) < 2e-2


def test_colours_and_moved_slices_keep_their_opacity():
    part = Slice(np.ones((4, 4)), Grid.square(4, 1 * um), 1 * mm, np.eye(4))
    moved = Scene([part]).at(1 * mm).scaled(2.0).parts[0]
    assert moved.hides
    assert moved.dz == 2 * mm
    assert part.trimmed().opacity.tolist() == np.eye(4).tolist()
    dark = Slice(np.zeros((4, 4)), Grid.square(4, 1 * um), opacity=np.diag([0, 1, 1, 0])).trimmed()
    assert dark.opacity.tolist() == np.eye(2).tolist()


@pytest.mark.parametrize("coherence", [Coherent(), Snapshots(1)])
def test_light_that_interferes_is_refused(coherence):
    camera = cameras.focused(**SMALL)
    with pytest.raises(GeometryError, match="-20 mm is opaque but coherence is"):
        simulate(camera, Scene([wall(-20 * mm), hiding.chart(camera, 0.0, 8, 2)]), coherence)


def test_cameras_without_lenslets_and_microscopes_are_refused():
    camera = SingleLensCamera(
        wavelength=550 * nm,
        object_distance=100 * mm,
        main_lens={"focal_length": 50 * mm, "diameter": 5 * mm},
        sensor={"shape": (32, 32), "pixel_pitch": 5 * um},
    )
    with pytest.raises(GeometryError, match="no lenslets"):
        simulate(camera, Scene([wall(-20 * mm)]))


@pytest.mark.parametrize(
    ("opacity", "message"),
    [
        (np.ones((3, 4)), r"opacity has shape \(3, 4\)"),
        (1.5, "between 1.5 and 1.5"),
        (np.full((4, 4), np.nan), "opacity has 16 NaN"),
    ],
)
def test_impossible_opacities_are_refused(opacity, message):
    with pytest.raises(GeometryError, match=message):
        Slice(np.ones((4, 4)), Grid.square(4, 1 * um), opacity=opacity)
