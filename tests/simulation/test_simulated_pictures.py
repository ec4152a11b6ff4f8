"""From a simulated raw image to pictures: places, orientation and focus, by wave optics end to end."""

import numpy as np
import pytest

from lumigraph.calibration import calibrate
from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.rendering import decode, refocus, refocus_stack, render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.scene import targets
from lumigraph.simulation import Incoherent, simulate
from lumigraph.units import mm, um


def spot(image, grid, around, radius):
    """Centroid (y, x) [m] of what stands above half of the peak within `radius` of a place."""
    y, x = grid.y[:, None] - around[0], grid.x - around[1]
    part = np.where(np.hypot(y, x) < radius, image, 0)
    part = np.maximum(part - part.max() / 2, 0)
    return np.array([(part * grid.y[:, None]).sum(), (part * grid.x).sum()]) / part.sum()


@pytest.mark.parametrize(
    ("name", "limit"),
    [("thesis-plenoptic-2-m050", 5 * um), ("thesis-plenoptic-2-m030", 12 * um), ("galilean", 12 * um)],
)
def test_a_point_is_rendered_at_its_true_place(name, limit):
    """The thesis' printed geometry displaces a point at 1 mm by 144 um (m = 0.5)."""
    camera = FocusedPlenopticCamera.from_catalogue(name)
    camera = camera.replace(sensor={"pixel_pitch": 3 * um}, lenslets={"count": (21, 21)})
    y, x = 0.45 * mm, -1.0 * mm
    raw = simulate(camera, targets.points([(y, x)]))
    picture = render(raw, camera.calibration, camera.patch)
    grid = rendered_grid(camera.calibration, camera.patch)
    place = np.array([y, x]) * camera.magnification
    assert np.abs(spot(picture, grid, place, 0.3 * mm) - place).max() < limit


def test_a_lattice_found_on_the_white_image_renders_as_well_as_the_known_one():
    camera = FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    camera = camera.replace(sensor={"pixel_pitch": 4 * um}, lenslets={"count": (21, 21)})
    found = calibrate(
        simulate(camera, targets.white()),
        separation=camera.separation,
        lenslet_distance=camera.lenslet_distance,
    )
    raw = simulate(camera, targets.points([(0.4 * mm, 0.8 * mm)]))
    spots = []
    for calibration in (found, camera.calibration):
        picture = render(raw, calibration, camera.patch)
        grid = rendered_grid(calibration, camera.patch)
        spots.append(spot(picture, grid, (0.4 * mm, 0.8 * mm), 0.3 * mm))
    assert np.abs(spots[0] - spots[1]).max() < 2 * um


def test_each_depth_of_a_1_0_camera_comes_into_focus_at_its_own_factor():
    """Concentration of a point over a focal stack; diffraction draws the peak towards 1 (section 4.7)."""
    camera = PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    camera = camera.replace(lenslets={"count": (25, 25)}, sensor={"pixel_pitch": 10 * um})
    alphas = np.linspace(0.8, 1.2, 21)
    best = []
    for dz in (-25 * mm, 0.0, 25 * mm):
        views = decode(simulate(camera, targets.points([(0.6 * mm, -0.3 * mm, dz)])), camera.calibration)
        stack = refocus_stack(views, alphas, oversample=1)
        best.append(alphas[(stack**2).sum((1, 2)).argmax()])
    assert best[1] == pytest.approx(1, abs=0.03)
    assert best[0] == pytest.approx(camera.alpha(-25 * mm), abs=0.045)
    assert best[2] == pytest.approx(camera.alpha(25 * mm), abs=0.045)


def test_a_picture_stands_upright_and_is_not_mirrored():
    """An F-like corner: bright top left, in 1.0 and in 2.0."""
    one = PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    one = one.replace(lenslets={"count": (15, 15)}, sensor={"pixel_pitch": 10 * um})
    two = FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    two = two.replace(lenslets={"count": (15, 15)}, sensor={"pixel_pitch": 5 * um})
    for camera in (one, two):
        n = camera.object_grid.shape[0]
        picture = np.zeros(camera.object_grid.shape)
        picture[n // 5 : 3 * n // 10, n // 5 : 4 * n // 5] = 1  # a bar along the top
        picture[n // 5 : 4 * n // 5, n // 5 : 3 * n // 10] = 1  # and one down the left side
        raw = simulate(camera, targets.photo(camera.object_grid, picture), Incoherent())
        if camera is one:
            shown = refocus(decode(raw, camera.calibration), 1.0, oversample=1)
        else:
            shown = render(raw, camera.calibration, camera.patch)
        m = shown.shape[0] // 2
        quarters = [shown[:m, :m], shown[:m, m:], shown[m:, :m], shown[m:, m:]]
        top_left, top_right, bottom_left, bottom_right = (quarter.mean() for quarter in quarters)
        assert top_left > 1.3 * max(top_right, bottom_left)
        assert min(top_right, bottom_left) > 3 * bottom_right
