"""Derivatives of bounds by the parts of a microscope with lenslets, beside central differences."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core.mirrored import Mirrored
from lumigraph.errors import GeometryError
from lumigraph.operators.microscope.pupil_points import WindowParts
from lumigraph.operators.microscope.pupil_waves import PupilWaves, behind, sampling_matrix, window_of
from lumigraph.studies.information import Light, bounds, slopes
from lumigraph.studies.information.bounds import PointInformation, deviations
from lumigraph.studies.information.followed import TracedThroughLenslets, before_lenslets
from lumigraph.studies.information.points import collected

UM = 1e-6
DEPTHS, LIGHT, PLACES = (-9 * UM, 12 * UM), Light(4000, 0.5), range(2)


def scope(aperture=0.5, magnification=20, waves=0.1, pixel=6.5 * UM, **changes) -> lg.LightFieldMicroscope:
    lenslets = {"pitch": 125 * UM, "focal_length": 2.5e-3, "count": (9, 9), "fill_factor": 0.98}
    objective = {
        "magnification": magnification,
        "numerical_aperture": aperture,
        "aberrations": {5: waves, 6: 0.1, 8: -0.1},
    }
    return lg.LightFieldMicroscope.model_validate(
        {
            "wavelength": 525e-9,
            "objective": {"tube_lens": 0.2, **objective, **changes.pop("objective", {})},
            "lenslets": {**lenslets, **changes.pop("lenslets", {})},
            "sensor": {"pixel_pitch": pixel, "shape": (150, 150), "read_noise": 1.0},
            **changes,
        }
    )


class Key(NamedTuple):
    """A value, a step, and the microscope that has it."""

    at: float
    step: float
    of: Callable[[float], lg.LightFieldMicroscope]


PLAIN = {
    "aperture, and so the light": Key(0.5, 2e-5, lambda v: scope(aperture=v)),
    "magnification": Key(20, 4e-4, lambda v: scope(magnification=v)),
    "wavelength": Key(525e-9, 1e-11, lambda v: scope(wavelength=v)),
    "pitch": Key(125 * UM, 1e-9, lambda v: scope(lenslets={"pitch": v})),
    "focal length of lenslets": Key(2.5e-3, 1e-7, lambda v: scope(lenslets={"focal_length": v})),
    "fill factor": Key(0.98, 1e-5, lambda v: scope(lenslets={"fill_factor": v})),
    "a turn": Key(0.01, 1e-6, lambda v: scope(lenslets={"rotation": v})),
    "phase of the pupil": Key(0.1, 3e-4, lambda v: scope(waves=v)),
    "pixels": Key(6.5 * UM, 1e-10, lambda v: scope(pixel=v)),
}
OTHER = {
    "lenslets before the image": Key(
        1e-3,
        2e-7,
        lambda v: scope(configuration="2.0", sensor_distance=3.4e-3, lenslet_offset=v),
    ),
    "the sensor": Key(
        3.4e-3,
        2e-7,
        lambda v: scope(configuration="2.0", sensor_distance=v, lenslet_offset=1e-3),
    ),
    "aperture, three polarised wavelengths": Key(
        0.35,
        2e-5,
        lambda v: scope(aperture=v, bandwidth=30e-9, objective={"model": "vector"}),
    ),
}


ROUND = {
    f"{name}, round": key._replace(
        of=lambda v, key=key: key.of(v).replace(lenslets={"shape": "round", "fill_factor": 0.93})
    )
    for name, key in (PLAIN | OTHER).items()
    if name not in ("fill factor", "pixels", "aperture, three polarised wavelengths")  # as of squares
}
ROUND["fill factor, round"] = PLAIN["fill factor"]._replace(
    at=0.93, of=lambda v: scope(lenslets={"shape": "round", "fill_factor": v})
)


def waves_alike(images, like, which: int, dz: float) -> tuple[tuple, PupilWaves]:
    """How an objective's window is sampled in images like others, and its waves sampled so."""
    told, waves = like.sampled(like.objectives[which], dz)
    ways = [(replace(each.objectives[which], aberrations=()), each.lenslet) for each in (images, like)]
    samples = sampling_matrix(told[0], told[1], images.layout.sampling)
    down, across, samples = map(Mirrored.of, (*behind(*ways, told), samples))
    window = window_of(*ways, told)
    return told, replace(waves, down=down, across=across, sampled=samples, window=window)


def sampled_alike(one, other) -> TracedThroughLenslets:
    """Points before the first, with all that is sampled as the other one asks for."""
    before = before_lenslets(other, [(one, one)], (np.array(DEPTHS), PLACES), 1e-2, double=True)
    own, like, parts = before.pairs[0][0], before.own.images, {}
    for which, dz in product(range(len(like.objectives)), DEPTHS):
        told, waves = waves_alike(own.images, like, which, dz)
        mine = own.images.sampled(own.images.objectives[which], dz)[0]
        parts[which, mine] = WindowParts(which, told, waves, False)
    return TracedThroughLenslets(own, [], parts)


def bound(before: TracedThroughLenslets, sensor, part: slice) -> float:
    """Of points before a microscope, rms."""
    found = [PointInformation.of(sensor, LIGHT, before.lit(k)[0]) for k in range(len(before.depths))]
    return float(np.sqrt(np.mean([deviations(one.fisher)[part] ** 2 for one in found])))


def check(key: Key, name, part):
    """Within 1e-4 of differences of four steps, in double precision."""
    at, step, of = key

    def value(k):
        one = of(at + k * step)
        return bound(sampled_alike(one, of(at)), one.sensor, part)

    found = slopes(of(at), [(of(at - step), of(at + step))], DEPTHS, LIGHT, name=name, places=2)
    near, far = (value(k) - value(-k) for k in (1, 2))
    assert found.bound == pytest.approx(value(0), rel=1e-5, abs=0)
    assert found.changes[0] == pytest.approx((8 * near - far) / 6, rel=1e-4, abs=0)


QUICK = "phase of the pupil"


def test_slopes_are_central_differences():
    check(PLAIN[QUICK], "depth", slice(2, 3))


@pytest.mark.long
@pytest.mark.parametrize("key", [key for key in PLAIN | OTHER | ROUND if key != QUICK])
def test_slopes_of_all_parts_are_central_differences(key):
    check((PLAIN | OTHER | ROUND)[key], "depth", slice(2, 3))


@pytest.mark.long
@pytest.mark.parametrize(("name", "part"), [("lateral", slice(0, 2)), ("brightness", slice(3, 4))])
@pytest.mark.parametrize("key", PLAIN)
def test_slopes_of_other_bounds_are_central_differences(key, name, part):
    check(PLAIN[key], name, part)


@pytest.mark.parametrize(
    ("pixel", "error"), [({}, 1e-5), pytest.param({"pixel": 6.25 * UM}, 5e-3, marks=pytest.mark.long)]
)
def test_the_bound_is_that_of_bounds(pixel, error):
    """Whose pixels are interpolated from other samples where lenslets are whole pixels wide."""
    one = scope(**pixel)
    known = bounds(one, DEPTHS, LIGHT, places=2)
    assert slopes(one, [], DEPTHS, LIGHT, places=2).bound == pytest.approx(known.depth, rel=error, abs=0)


@pytest.mark.long
@pytest.mark.parametrize("key", ["aperture, and so the light", "wavelength"])
def test_slopes_show_where_a_bound_changes(key):
    """Beside differences of bounds themselves, which sample each microscope as it asks for."""
    at, step, of = PLAIN[key]
    low, high = of(at - 5 * step), of(at + 5 * step)
    found = slopes(of(at), [(low, high)], DEPTHS, LIGHT, places=2)
    lights = [
        replace(LIGHT, photons=LIGHT.photons * collected(one) / collected(of(at))) for one in (low, high)
    ]
    known = [
        bounds(one, DEPTHS, light, places=2).depth for one, light in zip((low, high), lights, strict=True)
    ]
    assert found.changes[0] == pytest.approx(known[1] - known[0], rel=1e-3, abs=0)


def test_microscopes_without_waves_are_refused():
    with pytest.raises(GeometryError, match="need a model other than 'rays'"):
        slopes(scope(objective={"model": "rays", "aberrations": {}}), [], DEPTHS, LIGHT)


def test_pairs_with_other_lenslets_are_refused():
    with pytest.raises(GeometryError, match="different numbers of lenslets"):
        slopes(scope(), [(scope(), scope(lenslets={"count": (11, 9)}))], DEPTHS, LIGHT)
