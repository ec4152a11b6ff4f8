"""What is wrong with a camera, from its white image."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.calibration import diagnose
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError

PIXEL, PITCH, SEPARATION, DISTANCE, FOCAL = 5e-6, 150e-6, 0.1, 5.5e-3, 5.2e-3
TOTAL = SEPARATION + DISTANCE
SHAPE = (401, 451)
AXIS = np.array([200.0, 225.0])


@dataclass(frozen=True)
class Lenslets:
    pitch: float = PITCH
    focal_length: tuple[float, ...] = (FOCAL,)
    shape: str | None = "round"


@dataclass(frozen=True)
class Bench:
    calibration: Calibration
    lenslets: Lenslets = Lenslets()
    wavelength: float = 633e-9
    micro_image_width: float = PITCH
    micro_image_pitch: float = PITCH


def lattice(distance=DISTANCE, rotation=0.0, origin=(0.0, 0.0)):
    pitch = PITCH * (1 + distance / SEPARATION) / PIXEL
    return Lattice.square(pitch, rotation, tuple(AXIS + np.array(origin)))


def intended():
    none = np.zeros((0, 2))
    return Bench(Calibration(lattice(), SHAPE, none, none, 0.0, PIXEL, SEPARATION, DISTANCE))


def white(centers, diameter):
    """Sharp discs of a diameter [px], with soft edges of a pixel, where light adds up."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    picture = np.zeros(SHAPE)
    for cy, cx in centers:
        picture += np.clip(diameter / 2 - np.hypot(y - cy, x - cx) + 0.5, 0, 1)
    return picture


def discs(found, diameter=24.0):
    return white(found.centers((-50, SHAPE[0] + 50), (-50, SHAPE[1] + 50)), diameter)


def test_a_rotation_is_named_with_its_angle():
    found = diagnose(discs(lattice(rotation=math.radians(0.4))), intended())
    assert "rotation" in found.faults
    assert math.degrees(found.rotation) == pytest.approx(0.4, abs=0.005)
    assert "turned by +0.4" in found.report()


def test_an_offset_is_named_in_metres():
    found = diagnose(discs(lattice(origin=(2.0, -3.5))), intended())
    assert "offset" in found.faults
    assert found.offset == pytest.approx((2.0 * PIXEL, -3.5 * PIXEL), abs=0.02 * PIXEL)


def test_another_pitch_is_another_distance():
    found = diagnose(discs(lattice(distance=DISTANCE + 1e-3)), intended())
    assert "distance" in found.faults
    assert found.lenslet_distance - found.intended_distance == pytest.approx(1e-3, abs=2e-5)


def test_a_tilt_is_told_from_the_pitch_that_changes():
    angle = math.radians(3)
    c = (lattice().centers((-50, SHAPE[0] + 50), (-50, SHAPE[1] + 50)) - AXIS) * PIXEL / TOTAL * SEPARATION
    # Rays from the middle of the main lens through lenslets at c, turned about the y axis.
    scale = TOTAL / (SEPARATION + c[:, 1] * math.sin(angle))
    centers = np.stack([c[:, 0], c[:, 1] * math.cos(angle)], 1) * scale[:, None] / PIXEL + AXIS
    found = diagnose(white(centers, 24.0), intended())
    assert "tilt" in found.faults
    assert "distance" not in found.faults
    assert math.degrees(found.tilt[1]) == pytest.approx(3, abs=0.1)
    assert math.degrees(found.tilt[0]) == pytest.approx(0, abs=0.1)
    assert found.pitch_gradient[1] < 0


@pytest.mark.parametrize(
    ("relative", "fault"), [(0.6, "gap"), (1.0, ""), (1.12, "overlap"), (1.5, "overlap")]
)
def test_gaps_and_overlaps_are_measured_and_the_matching_lens_is_told(relative, fault):
    # In the lenslets' focus (for the main lens) only diffraction blurs.
    sharp = 1 / (1 / FOCAL - 1 / SEPARATION)
    camera = intended()
    pitch = PITCH * (1 + sharp / SEPARATION) / PIXEL
    grid = Lattice.square(pitch, origin=tuple(AXIS))
    camera = Bench(
        replace(camera.calibration, lattice=grid, lenslet_distance=sharp), replace(camera.lenslets), 1e-9
    )
    found = diagnose(discs(grid, relative * pitch), camera)
    assert found.faults == ((fault,) if fault else ())
    assert found.width / (found.width + found.gap) == pytest.approx(relative, abs=0.012)
    assert found.intended_diameter == pytest.approx(pitch * PIXEL * SEPARATION / sharp, rel=1e-3)
    assert found.diameter / found.intended_diameter == pytest.approx(relative, abs=0.012)
    assert ("as it was meant" in found.report()) == (not fault)


def test_a_simulated_camera_as_it_was_meant_has_no_fault():
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050").replace(
        lenslets={"count": (9, 9)}, sensor={"pixel_pitch": 5e-6}, main_lens={"diameter": 2.7577e-3}
    )
    found = diagnose(lg.simulate(camera, lg.targets.white()), camera)
    assert found.faults == ()
    assert found.diameter == pytest.approx(2.7577e-3, rel=0.005)


def test_lengths_must_be_known():
    camera = intended()
    camera = Bench(replace(camera.calibration, separation=None))
    with pytest.raises(CalibrationError, match="separation or lenslet_distance is not known"):
        diagnose(discs(lattice()), camera)


def test_the_white_image_must_fit_the_sensor():
    with pytest.raises(CalibrationError, match="401 x 451"):
        diagnose(np.ones((10, 10)), intended())
