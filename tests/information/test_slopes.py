"""Derivatives of bounds by a Fourier microscope's parts, beside central differences of bounds."""

import pytest

import lumigraph as lg
from lumigraph.errors import GeometryError
from lumigraph.information import Light, bounds, slopes
from lumigraph.information.points import collected
from lumigraph.operators.fourier_changes import Behind

UM = 1e-6
DEPTHS, LIGHT = (-9 * UM, 4 * UM), Light(4000, 0.5)
SINGLE = {
    1: {"focal_change": 0.01, "offset_y": "-10 um"},
    2: {"focal_change": -0.01, "offset_x": "14 um"},
    4: {"focal_change": 0.02, "offset_y": "30 um", "offset_x": "12 um"},
}


def scope(
    relay=75e-3, change=0.01, at=(30 * UM, 12 * UM), waves=0.2, pixel=6.5 * UM, **changes
) -> lg.LightFieldMicroscope:
    single = {**SINGLE, 4: {"focal_change": change, "offset_y": at[0], "offset_x": at[1]}}
    lenslets = {
        "count": (2, 2),
        "pitch": 1.6e-3,
        "focal_length": 20e-3,
        "single": single,
        "fill_factor": 0.97,
    }
    return lg.LightFieldMicroscope.from_catalogue("lfm-fourier").replace(
        fourier_lens=relay,
        objective={"aberrations": {5: 0.1, 6: waves, 8: -0.1}, **changes.pop("objective", {})},
        lenslets={**lenslets, **changes.pop("lenslets", {})},
        sensor={"pixel_pitch": pixel, "shape": (560, 560)},
        **changes,
    )


KEYS = {
    "focal length of the relay": (75e-3, 2e-7, lambda v: scope(relay=v)),
    "focal length of a lenslet": (0.01, 1e-5, lambda v: scope(change=v)),
    "place of a lenslet": (30 * UM, 3e-9, lambda v: scope(at=(v, 12 * UM))),
    "pitch": (1.6e-3, 5e-9, lambda v: scope(lenslets={"pitch": v})),
    "focal length of all": (20e-3, 5e-7, lambda v: scope(lenslets={"focal_length": v})),
    "place of the sensor": (20e-3, 5e-7, lambda v: scope(sensor_distance=v)),
    "phase of the pupil": (0.2, 1e-4, lambda v: scope(waves=v)),
    "wavelength": (525e-9, 1e-11, lambda v: scope(wavelength=v)),
    "pixels": (6.5 * UM, 1e-11, lambda v: scope(pixel=v)),
    "aperture, and so the light": (0.5, 1e-6, lambda v: scope(objective={"numerical_aperture": v})),
}


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("name", ["depth", "lateral", "brightness"])
def test_slopes_are_central_differences_of_bounds(key, name):
    """Within 1e-4 of those of four steps; steps are short, for a pupil's rim is smoothed over one sample."""
    at, step, of = KEYS[key]

    def bound(value):
        one = of(value)
        light = Light(LIGHT.photons * collected(one) / collected(of(at)), LIGHT.background)
        return getattr(bounds(one, DEPTHS, light, places=2), name)

    found = slopes(of(at), [(of(at - step), of(at + step))], DEPTHS, LIGHT, name=name, places=2)
    near, far = (bound(at + k * step) - bound(at - k * step) for k in (1, 2))
    assert found.bound == pytest.approx(bound(at), rel=1e-9, abs=0)
    assert found.changes[0] == pytest.approx((8 * near - far) / 6, rel=1e-4, abs=0)


def test_all_keys_together_cost_less_than_five_bounds_each_way(counted_fields):
    """Fields behind lenslets are what takes time: forwards once, twice for the waves' turn, and backwards."""
    pairs = [(of(at - step), of(at + step)) for at, step, of in KEYS.values()]
    slopes(scope(), pairs, DEPTHS, LIGHT, places=2)
    assert counted_fields() == 3 * 4 * len(DEPTHS) * 2


@pytest.fixture
def counted_fields(monkeypatch):
    """How often fields behind a lenslet were computed."""
    own, count = Behind.of.__func__, []

    def of(cls, *args):
        count.append(1)
        return own(cls, *args)

    monkeypatch.setattr(Behind, "of", classmethod(of))
    return lambda: len(count)


@pytest.mark.parametrize(
    "other",
    [
        lg.load_camera("lfm-guv"),
        scope().replace(sensor={"read_noise": 1.0}),
        scope().replace(lenslets={"count": (3, 3)}),
    ],
)
def test_what_has_no_derivatives_is_refused(other):
    with pytest.raises(GeometryError, match=r"[Uu]se search 'local'"):
        slopes(scope(), [(scope(), other)], DEPTHS, LIGHT)


def test_points_that_are_not_told_are_refused():
    """By one pixel."""
    one = lg.load_camera("lfm-fourier").replace(sensor={"shape": (1, 1)})
    with pytest.raises(GeometryError, match="do not determine depth at 0 m"):
        slopes(one, [], [0.0], LIGHT, places=1)
