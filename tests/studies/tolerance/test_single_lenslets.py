"""What lenslets that differ do to measures: beside rays, wave optics, and cameras by chance."""

import math

import numpy as np
import pytest

import cluster_jobs as jobs
import lumigraph as lg
from cameras import focused
from lumigraph.elements import form
from lumigraph.elements.scatter import Scatter
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments import Tolerance
from lumigraph.scene import Scene
from lumigraph.studies.tolerance import built, study
from lumigraph.studies.tolerance.single import AxisView
from lumigraph.studies.tolerance.trials import ToleranceTrials

UM = 1e-6
EACH = {
    "lenslets.each.focal_length": "±0.2 %", "lenslets.each.decentre": "±0.5 um",
    "lenslets.each.missing": "3 %",
}  # fmt: skip


@pytest.fixture(scope="module")
def camera():
    return lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")


def of_index(index):
    plain = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    return plain.replace(lenslets=plain.lenslets.model_copy(update={"index": index}))


def measured(meant, made):
    return {row.name: row.value for row in lg.tolerance.measures(meant, made)}


def traced(camera, distance, scatter):
    """Middles of a point's images behind the lenslets that see it, from their white middles: slope per metre.

    Rays from a point on the axis through the stop, by the lens equation of each lens, one by one.
    """
    f, L, b, p = (camera.main_lens.focal_length, camera.separation, camera.lenslet_distance,
                  camera.lenslets.pitch)  # fmt: skip
    side = camera.pupil_diameter * ((np.arange(400) + 0.5) / 400 - 0.5)
    y, x = np.meshgrid(side, side, indexing="ij")
    stop = np.stack([y, x], -1)[np.hypot(y, x) <= camera.pupil_diameter / 2]
    slope = stop * (1 / distance - 1 / f)
    hit = stop + L * slope
    index = np.round(hit / p).astype(int)
    factor, down, across, there = scatter.of(*index.T)
    vertex = index * p + np.stack([down, across], -1)
    bent = slope - (hit - vertex) / (camera.lenslets.focal_length[0] * factor)[:, None]
    moved = (hit + b * bent - index * p * (1 + b / L))[there]
    table = np.zeros((2 * there.sum(), 3))
    table[:, 0], table[::2, 1], table[1::2, 2] = (index[there] * p).ravel(), 1, 1
    return np.linalg.lstsq(table, moved.ravel(), rcond=None)[0][0]


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_depth_is_read_as_rays_through_these_lenslets_say(camera, missing):
    """To 2 % of its spread: light is shared out by 400 and by 128 rays across."""
    told, expected = [], []
    for seed in range(5):
        made = camera.replace(built={"decentre_scatter": 4 * UM, "missing": missing, "seed": seed})
        images = traced(made, camera.object_distance, made.scatter)
        z2 = camera.separation / (1 + camera.lenslet_distance / (camera.separation * images))
        expected.append(1 / (1 / camera.main_lens.focal_length - 1 / z2) - camera.object_distance)
        told.append(measured(camera, made)["depth error"])
    assert np.std(expected) > 100 * UM
    np.testing.assert_allclose(told, expected, rtol=0, atol=0.02 * np.std(expected))


def test_a_decentred_lenslet_moves_its_micro_image_and_a_strong_one_its_focus(camera):
    made = camera.replace(built={"decentre_scatter": 2 * UM, "focal_length_scatter": 0.01, "seed": 5})
    found, (i, j) = measured(camera, made), camera.lenslets.indices()[-1:].T
    factor, down, across, _ = (float(one[0]) for one in made.scatter.of(i, j))
    by = -camera.lenslet_distance / (camera.lenslets.focal_length[0] * factor) / camera.pixels.pixel_pitch
    assert found["corner shift y"] == pytest.approx(by * down)
    assert found["corner shift x"] == pytest.approx(by * across)
    factor = float(made.scatter.of(np.array([0]), np.array([0]))[0][0])
    alone = built(camera, {"lenslets.focal_length": (factor - 1) * camera.lenslets.focal_length[0]})
    assert found["focus shift"] == 0
    assert found["lenslet focus shift"] == pytest.approx(measured(camera, alone)["focus shift"])
    assert found["blur behind a lenslet"] == pytest.approx(measured(camera, alone)["blur behind a lenslet"])


def test_light_of_a_point_is_lost_on_missing_lenslets_as_by_wave_optics():
    """To 0.1 of all: the stop's Airy disc is as wide as a lenslet here."""
    meant, point = focused(), lg.Points(np.zeros((1, 3)), np.ones(1))
    whole = np.sum(lg.simulate(meant, Scene([point])).data)
    parts = []
    for seed in range(6):
        made = meant.replace(built={"missing": 0.3, "seed": seed})
        parts.append(np.sum(lg.simulate(made, Scene([point])).data) / whole)
        assert measured(meant, made)["light of a point"] == pytest.approx(parts[-1], abs=0.1)
    assert np.ptp(parts) > 0.3


def test_first_order_agrees_with_cameras_by_chance(camera):
    """Of small errors to 10 %, where the statistical error of 400 is 3.5 %."""
    names = ("depth error", "lenslet focus shift", "blur at the object", "corner shift y", "corner shift x")
    found = study(camera, EACH, draws=400, seed=2, measure=[*names, "light of a point", "focus shift"])
    for name in names:
        one = found[name]
        assert one.first_order == pytest.approx(one.deviation, rel=0.1), name
        assert one.is_linear, name
    light = found["light of a point"]
    assert light.first_order == pytest.approx(light.deviation, abs=3.5 * light.deviation_error)
    assert light.first_order == pytest.approx(  # a chance q for each share of the light
        math.sqrt(0.03 * 0.97 * np.sum(AxisView.of(camera).shares ** 2))
    )
    assert light.mean == pytest.approx(0.97, abs=4 * light.mean_error)
    assert not found["focus shift"].changes
    assert light.ranked(found.names)[0] == ("lenslets.each.missing", 1.0)


def test_tilt_and_form_to_first_order_are_those_of_cameras_by_chance():
    """To 10 %, where the statistical error of 300 is 4 %."""
    camera = of_index(1.46)
    given = {"lenslets.each.tilt": "±0.1 mrad", "lenslets.each.form": "±10 nm"}
    names = ("depth error", "corner shift y", "corner shift x")
    found = study(camera, given, draws=300, seed=4, measure=[*names, "lenslet Strehl ratio"])
    for name in names:
        assert found[name].first_order == pytest.approx(found[name].deviation, rel=0.1), name
    strehl = 1 - (2 * np.pi * 5e-9 / camera.wavelength) ** 2
    assert found["lenslet Strehl ratio"].mean == pytest.approx(strehl, abs=0.05 * (1 - strehl))


def test_a_tilt_is_the_decentre_that_turns_light_as_much(camera):
    glass, f = of_index(1.46), camera.lenslets.focal_length[0]
    tilted = study(glass, {"lenslets.each.tilt": "±1 mrad"}, draws=2, measure=["depth error"])
    moved = {"lenslets.each.decentre": f"±{0.46e-3 * f * 1e6} um"}
    moved = study(glass, moved, draws=2, measure=["depth error"])
    assert tilted["depth error"].first_order == pytest.approx(moved["depth error"].first_order, rel=1e-9)
    with pytest.raises(GeometryError, match="their index n is not known"):
        study(camera, {"lenslets.each.tilt": "±1 mrad"}, draws=2)


def test_the_middle_of_light_moves_as_the_mean_slope_says():
    """By a Fourier transform of a square aperture with that path, to what a window of 300 discs leaves."""
    terms = np.random.default_rng(3).normal(size=len(form.TERMS)) * 0.03  # waves
    n, pad = 512, 4
    at = (2 * np.arange(n) + 1) / n - 1
    light = np.zeros((n * pad, n * pad), complex)
    light[:n, :n] = np.exp(2j * np.pi * form.path(terms, at, at))
    image = np.abs(np.fft.fft2(light)) ** 2
    for k, slope in enumerate(form.slopes(terms)):
        turns = np.fft.fftfreq(n * pad)  # periods per sample, of which a half has n / 2
        near = np.abs(turns) < 0.3
        line = image.sum(1 - k)[near]
        assert line @ turns[near] / line.sum() * n / 2 == pytest.approx(slope, abs=0.02 * np.abs(terms).max())


def test_tilt_and_form_move_the_last_micro_image():
    """By b times the angle, and by b times the mean slope: Σ √(2m+1) of odd terms of one direction."""
    camera = of_index(1.46)
    made = camera.replace(built={"tilt_scatter": 1e-3, "form_scatter": 2e-8, "seed": 6})
    warp = made.scatter.warp(*camera.lenslets.indices()[-1:].T)
    third, half = math.sqrt(7), camera.lenslets.pitch / 2  # P₃ rises by 2 across the lenslet
    y = float(warp.down[0] + third * warp.terms[0, 2] / half)
    x = float(warp.across[0] + third * warp.terms[0, 5] / half)
    by = -camera.lenslet_distance / camera.pixels.pixel_pitch
    found = measured(camera, made)
    assert (found["corner shift y"], found["corner shift x"]) == pytest.approx((by * y, by * x))
    assert made.scatter.turn == pytest.approx(0.46e-3)


def test_nine_lenslets_average_decentres_of_their_own(camera):
    """To first order, d b/f of each over the root of the sum of its squared lever arms."""
    found = study(camera, {"lenslets.each.decentre": "±1 um"}, draws=2, measure=["depth error"])[
        "depth error"
    ]
    sight = AxisView.of(camera)
    places, shares = camera.lattice.position(sight.indices), sight.shares[:, None]
    levers = shares * places / np.sum(shares * places**2)
    b, f = camera.lenslet_distance, camera.lenslets.focal_length[0]
    slope = 0.5 * UM * b / f * np.sqrt(np.sum(levers**2))
    known = camera.lenslet_distance * camera.image_distance / (camera.relay_distance * camera.separation)
    relay = camera.relay_distance * slope / known  # a is read from 1/a
    per_metre = (
        (camera.object_distance / camera.image_distance) ** 2 * camera.image_distance / camera.separation
    )
    assert found.first_order == pytest.approx(relay * per_metre, rel=1e-3)


def test_a_kill_in_between_leaves_the_same_lenslets(camera, tmp_path):
    trials = ToleranceTrials.of(camera, EACH, ["depth error", "light of a point"])
    out = tmp_path / "t.csv"
    lg.cluster.batch(trials, trials.items(20), out, what=trials.what, part=(1, 3), workers=jobs.Here())
    found = study(camera, EACH, draws=20, measure=trials.names, output=out, workers=jobs.Here())
    alone = study(camera, EACH, draws=20, measure=trials.names)
    for one, other in zip(found.outcomes, alone.outcomes, strict=True):
        np.testing.assert_array_equal(one.sample, other.sample)
    with lg.cluster.rows(out) as rows:
        seeds = {row["built.seed"] for row in rows} - {None}
    assert len(seeds) == 20


def test_a_drawn_camera_is_found_again_by_its_seed(camera):
    (one, other) = lg.tolerance.cameras(camera, EACH, 2, seed=3)
    assert one.scatter == Scatter(0.001, 0.25 * UM, 0.03, one.built.seed)
    assert one.built.seed != other.built.seed
    errors = {f"lenslets.each.{key}": value for key, value in (
        ("decentre", 0.25 * UM), ("missing", 0.03), ("focal_length", 0.001 * 5.2e-3)
    )}  # fmt: skip
    errors["built.seed"] = one.built.seed
    assert built(camera, errors).scatter == one.scatter
    assert Tolerance.parse("lenslets.each.missing", "0.2 %") == Tolerance("lenslets.each.missing", 0.002)
    assert str(Tolerance.parse("lenslets.each.missing", "0.002")) == "0.2 %"


def test_a_camera_whose_point_is_seen_by_one_lenslet_alone_cannot_be_read(camera):
    """Nine see it; with 70 % missing, one or none of them is left in 20 % of the cameras."""
    found = study(camera, {"lenslets.each.missing": "70 %"}, draws=100, measure=["depth error"])
    alone = 0.7**9 + 9 * 0.7**8 * 0.3
    assert len(found.failures) == pytest.approx(100 * alone, abs=4 * math.sqrt(100 * alone * (1 - alone)))
    assert "of the 9 lenslets that see a point are there" in found.failures[0]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"lenslets.each.missing": "±1 %"}, "must be like '0.2 %'"),
        ({"lenslets.each.missing": "0 %"}, "must be above zero"),
        ({"lenslets.each.missing": "100 %"}, "must be at most 0.99"),
        ({"lenslets.each.decentre": "±1 %"}, "is 0, and ±1 % of it is nothing"),
        ({"lenslets.each.decentre": "±1 um uniform"}, "lenslets differ normally"),
        ({"lenslets.each.decenter": "±1 um"}, "Did you mean 'lenslets.each.decentre'"),
        ({"lenslets.each.tilt": "±1 mm"}, "tolerance of lenslets.each.tilt: '1 mm' is not an angle"),
        ({"lenslets.each.form": "±1 %"}, "is 0, and ±1 % of it is nothing"),
        ({"lenslets.each.form": "±1 mm"}, "form is 0.0005 m but must be from 0 to 1e-05 m"),
        ({"lenslets.each.focal_length": "±50 %"}, "must be from 0 to 0.2"),
    ],
)
def test_what_no_lenslet_can_have_is_refused(camera, given, told):
    with pytest.raises((FormatError, GeometryError), match=told):
        study(camera, given, draws=2)


def test_what_cannot_go_together_is_refused(camera):
    with pytest.raises(FormatError, match=r"the lenslets of \[built\] differ already"):
        study(camera.replace(built={"missing": 0.1}), EACH, draws=2)
    with pytest.raises(GeometryError, match="mtf50_middle is simulated by an operator"):
        study(camera, EACH, draws=2, measure=["mtf50_middle"])
