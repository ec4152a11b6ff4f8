"""Derivatives of the error of reconstructed scenes, beside central differences of it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core.linear import Linear
from lumigraph.errors import GeometryError
from lumigraph.studies.information import Light, Scenes, imaging, reconstruction_slopes
from lumigraph.studies.information.points import small
from lumigraph.studies.information.reconstruction import probed
from lumigraph.studies.information.reconstruction_slopes import sloped
from lumigraph.units import mm, nm, um

DZ, SCENES, LIGHT = -3 * mm, Scenes(45 * um, 8), Light(2000)
ALONE, BOTH = (DZ,), (DZ, 2 * mm)


def camera(focal_length=5.2 * mm, pixel_pitch=10 * um, object_distance=120 * mm, **changes):
    given = {
        "object_distance": object_distance,
        "wavelength": 633 * nm,
        "main_lens": {"focal_length": 60 * mm, "diameter": 0.8 * mm},
        "lenslets": {
            "pitch": 0.2 * mm, "focal_length": focal_length, "count": (3, 3), "magnification": 0.5,
        },
        "sensor": {"pixel_pitch": pixel_pitch},
    }  # fmt: skip
    return lg.FocusedPlenopticCamera(**(given | changes))


@dataclass(frozen=True, eq=False)
class Matrix(Linear):
    """What a camera's `part_volume` does to each sample."""

    of: np.ndarray = None

    @property
    def shape(self):
        return self.of.shape[1:], (len(self.depths), *self.object_grid.shape)

    def _forward(self, x):
        return np.tensordot(x.ravel(), self.of, axes=1)

    def _adjoint(self, raw):
        return np.tensordot(self.of, raw, axes=2).reshape(self.shape[1])

    @property
    def memory_bytes(self):
        return self.of.nbytes


def seen_by(cut, depths, pairs=()):
    """Raw images by the camera's `part_volume` in double precision, and the planes."""
    known = imaging.imaging(cut, np.array(depths), SCENES, LIGHT, 1e-2)
    grid, planes = known.operator.object_grid, len(depths)
    part = cut.part_volume(list(pairs), grid, depths)
    each = np.eye(grid.shape[0] ** 2).reshape(-1, *grid.shape)
    raws = np.concatenate([plane.forward(each) for plane in part.planes])
    operator, sensor = Matrix(object_grid=grid, depths=depths, of=raws), cut.sensor
    mean = imaging._forward(operator, known.across, known.light, np.ones((planes, 8, 8)))
    mean = mean + sensor.dark_signal
    noise = np.sqrt(mean + imaging.reading(sensor) ** 2)
    return replace(known, operator=operator, mean=mean, noise=noise), part


def cut(one, depths, like=None):
    return small(one, np.array(depths), SCENES.size, like)


@pytest.mark.parametrize(
    ("depths", "key", "value", "step"),
    [
        (ALONE, "object_distance", 120 * mm, 1e-4),
        pytest.param(ALONE, "pixel_pitch", 10 * um, 1e-3, marks=pytest.mark.long),
        pytest.param(ALONE, "focal_length", 5.2 * mm, 1e-3, marks=pytest.mark.long),
        pytest.param(BOTH, "object_distance", 120 * mm, 1e-4, marks=pytest.mark.long),
        pytest.param(BOTH, "pixel_pitch", 10 * um, 1e-3, marks=pytest.mark.long),
    ],
    ids=["object_distance", "pixel_pitch", "focal_length", "volume, object_distance", "volume, pixel_pitch"],
)
def test_slopes_are_central_differences_of_the_same_estimate(depths, key, value, step, monkeypatch):
    """The pixels' pitch changes a pixel's light, too; lenslets' focal length hardly changes the error."""
    monkeypatch.setattr(imaging, "ENOUGH", 1e-10)
    own = cut(camera(), depths)
    ends = {
        h: [cut(camera(**{key: value * (1 + s * h)}), depths, own) for s in (-1, 1)] for h in (1e-6, step)
    }
    seen, part = seen_by(own, depths, [tuple(ends[1e-6])])
    low, high = (imaging.electrons(end, np.array(depths), SCENES, LIGHT) for end in ends[1e-6])
    slope = sloped(seen, part, probed(seen, 8).found, (high - low)[None])[0]
    low, high = (probed(seen_by(end, depths)[0], 8).left.sum() for end in ends[step])
    assert step / 1e-6 * slope == pytest.approx(high - low, rel=2e-3, abs=0)


def test_slopes_are_told_with_the_error_and_over_depths():
    pair = camera(5.1999 * mm), camera(5.2001 * mm)
    each = [reconstruction_slopes(camera(), [pair], [dz], SCENES, LIGHT) for dz in (DZ, 2 * mm)]
    both = reconstruction_slopes(camera(), [pair], (DZ, 2 * mm), SCENES, LIGHT)
    alone = lg.information.reconstruction_error(camera(), (DZ, 2 * mm), SCENES, LIGHT)
    assert both.bound == pytest.approx(alone.value, rel=1e-6)
    whole = sum(one.bound * one.changes for one in each) / (2 * both.bound)
    assert both.changes == pytest.approx(whole, rel=1e-6)


@pytest.mark.long
def test_slopes_of_a_volume_are_of_the_error_of_all_depths_together():
    pair = camera(5.1999 * mm), camera(5.2001 * mm)
    both = reconstruction_slopes(camera(), [pair], BOTH, SCENES, LIGHT, volume=True)
    error = lg.information.reconstruction_error(camera(), BOTH, SCENES, LIGHT, volume=True)
    assert both.bound == pytest.approx(error.value, rel=1e-6)
    assert both.bound > reconstruction_slopes(camera(), [pair], BOTH, SCENES, LIGHT).bound


def test_other_instruments_and_sensors_are_refused():
    other = camera(sensor={"pixel_pitch": 10 * um, "read_noise": 7.0})
    with pytest.raises(GeometryError, match="by the optics and the pixels' pitch"):
        reconstruction_slopes(camera(), [(camera(), other)], [DZ], SCENES)
