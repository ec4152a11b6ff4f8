"""Images of points by the pupil's phase, against the simulation, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core.lattice import Lattice
from lumigraph.core.matrix import Matrix
from lumigraph.operators.microscope.pupil import PLACES, PupilImages
from lumigraph.operators.sampling.resampling import Resampling

TERMS = tuple(range(4, 16))
SCOPE = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
    wavelength="525 nm",
    objective={
        "magnification": 20.0, "numerical_aperture": 0.5, "immersion_index": 1.0, "model": "scalar",
        "maker": None, "tube_lens": None,
    },
    lenslets={"pitch": "125 um", "count": (5, 5)},
    sensor={"shape": (95, 95)},
)  # fmt: skip
ROUND = SCOPE.replace(lenslets={"shape": "round", "fill_factor": 0.95})
POINTS = lg.Points(np.array([[1e-6, -3e-6, 5e-6], [8.2e-6, 5e-6, -7e-6]]), np.array([1.0, 2.0]))
SOME = 0.4 * np.random.default_rng(0).normal(size=len(TERMS)) / np.sqrt(len(TERMS))


def images(scope=SCOPE, terms=TERMS, **options):
    return scope.pupil_images(terms, **{"farthest": 7e-6, "accuracy": 0.1, "double": True, **options})


def off(found, true):
    return np.linalg.norm(found - true) / np.linalg.norm(true)


@pytest.mark.parametrize("waves", [pytest.param(w, marks=pytest.mark.long) for w in (0.0, 1.0, 2.5)])
def test_images_are_those_of_the_simulation_which_propagates_on_a_grid(waves):
    bent = SCOPE.replace(objective={"aberrations": dict(zip(TERMS, waves * SOME, strict=True))})
    scene, how = lg.Scene((POINTS,)), lg.Incoherent(accuracy=5e-3)
    true = np.asarray(lg.simulate(bent, scene, coherence=how).data)
    # Their own accuracies add. A wrong sign of the lenslet's distance or of the aberrations is off by 0.5.
    assert off(images(accuracy=1e-2, double=False).forward(POINTS, waves * SOME), true) < 1.5e-2


@pytest.mark.parametrize(
    "scope", [pytest.param(SCOPE, id="square"), pytest.param(ROUND, id="round", marks=pytest.mark.long)]
)
def test_images_of_an_aberrated_point_are_those_of_the_simulation(scope):
    bent, one = scope.replace(objective={"aberrations": {7: 0.2, 9: -0.1}}), POINTS.positions[:1]
    true = bent.point_image(*one[0], accuracy=3e-2)
    found = images(scope, (7, 9), accuracy=3e-2).forward(lg.Points(one, np.ones(1)), np.array([0.2, -0.1]))
    assert off(found, true) < 4e-2


@pytest.mark.parametrize(("waves", "dz"), [(0.0, 7e-6), (1.0, -6e-6), (2.5, 0.0)])
def test_the_pupils_nodes_are_as_many_as_images_need(waves, dz, monkeypatch):
    """Twice as many change an image by little of its accuracy; half of them repeat it within the window."""
    model, own = images(double=False, accuracy=3e-2), PupilImages._size
    point = lg.Points(np.array([[2e-6, -1e-6, dz]]), np.ones(1))

    def image(times):
        monkeypatch.setattr(
            PupilImages, "_size", lambda *given: (*own(*given)[:2], round(times * own(*given)[2]))
        )
        return model.forward(point, waves * SOME)

    true = image(2)
    assert off(image(1), true) < 0.05 * model.accuracy
    assert off(image(0.5), true) > 0.1 * model.accuracy


def test_known_aberrations_and_coefficients_add_up():
    bent = SCOPE.replace(objective={"aberrations": {7: 0.2, 30: 0.1}})
    both = SCOPE.replace(objective={"aberrations": {7: 0.3, 30: 0.1}})
    found = images(bent, (7,), pixels=19).forward(POINTS, np.array([0.1]))
    np.testing.assert_allclose(
        found, images(both, (7,), pixels=19).forward(POINTS, np.zeros(1)), atol=1e-9 * found.max()
    )


def spread(model, image, cell):
    """The raw image of a window."""
    whole, (part, pixels) = np.zeros(model.shape), model.seen(image[None], cell)
    whole[part] = pixels[0]
    return whole


def calibrated(pitch, rotation):
    """Of 19 x 19 pixels a lenslet as the sensor's are, of others, or turned."""
    return replace(SCOPE.calibration, lattice=Lattice.square(pitch, rotation, (47.0, 47.0)))


@pytest.mark.parametrize(
    ("pitch", "rotation"), [(19.0, 0.0), (19.23, 0.0), (19.23, 0.05)], ids=["pixels", "between", "turned"]
)
def test_the_part_that_a_window_lights_holds_all_of_its_light(pitch, rotation):
    model = replace(images(terms=(7,), pixels=calibrated(pitch, rotation)), accuracy=0.3)
    kinds = {"between": Resampling, "turned": Matrix}
    name = "turned" if rotation else "pixels" if pitch == 19 else "between"
    assert type(model.layout.placement) is kinds.get(name, type(None))
    for place, most in (((1e-6, -3e-6, 5e-6), 1.0), ((14e-6, -14e-6, 0.0), 0.7), ((0.0, 90e-6, 0.0), 0.0)):
        point = lg.Points(np.array([place]), np.ones(1))
        (lit,) = model.lit(point, np.array([0.2]))
        part, _ = model.seen(lit.image[None], lit.cell)
        true = model.forward(point, np.array([0.2]))
        assert np.allclose(spread(model, lit.image, lit.cell), true, rtol=0, atol=1e-12 * true.max())
        assert np.prod([p.stop - p.start for p in part]) <= most * true.size


def test_coefficients_that_are_fixed_give_the_same_image_and_no_derivatives():
    model = images(SCOPE.replace(objective={"aberrations": {7: 0.1}}))
    fixed = model.fixed(SOME)
    np.testing.assert_allclose(fixed.forward(POINTS, np.zeros(0)), model.forward(POINTS, SOME), rtol=1e-9)
    ours, theirs = (next(m.lit(POINTS, c)).changes for m, c in ((fixed, np.zeros(0)), (model, SOME)))
    np.testing.assert_allclose(ours, theirs[-PLACES:], rtol=1e-9, atol=1e-12 * np.abs(theirs).max())


@pytest.mark.parametrize("scope", [SCOPE, ROUND], ids=["square", "round"])
def test_every_terms_derivative_is_that_of_central_differences(scope):
    model, h = images(scope), 1e-4
    for direction in np.eye(len(TERMS))[:: 1 if scope is SCOPE else 4]:
        ahead, behind = (model.forward(POINTS, SOME + s * h * direction) for s in (1, -1))
        # The differences' own error is h² times the third derivative, 1e-6 here.
        assert off(model.derivative(POINTS, SOME, direction), (ahead - behind) / (2 * h)) < 1e-5


@pytest.mark.parametrize("axis", range(PLACES))
def test_derivatives_by_a_points_place_are_those_of_central_differences(axis):
    model, step = images(), 1e-9 * np.eye(PLACES)[axis]
    for p, lit in enumerate(model.lit(POINTS, SOME)):
        ahead, behind = (
            model.forward(lg.Points(POINTS.positions[p : p + 1] + s * step, np.ones(1)), SOME)
            for s in (1, -1)
        )
        found = spread(model, lit.changes[len(TERMS) + axis], lit.cell)
        assert off(found, (ahead - behind) / 2e-9) < 1e-4


@pytest.mark.parametrize(
    "scope",
    [
        SCOPE,
        SCOPE.replace(objective={"model": "vector"}),
        SCOPE.replace(objective={"numerical_aperture": 1.2, "immersion_index": 1.33, "magnification": 60.0}),
        ROUND,
    ],
    ids=["scalar", "vector", "60x/1.2", "round"],
)
def test_gradient_is_the_derivatives_transpose(scope):
    scope, rng = scope.replace(bandwidth="30 nm"), np.random.default_rng(1)
    model = images(scope, (4, 6, 8))
    points = lg.Points(POINTS.positions / 4, POINTS.intensities)
    c, change, weights = rng.normal(size=3) / 10, rng.normal(size=3), rng.normal(size=model.shape)
    there = float((model.derivative(points, c, change) * weights).sum())
    assert float(model.gradient(points, c, weights) @ change) == pytest.approx(there, rel=1e-9, abs=0)


def test_piston_changes_nothing_and_tilt_is_a_place():
    model = images(terms=(1, 2))
    piston, tilt = (model.derivative(POINTS, np.zeros(2), d) for d in np.eye(2))
    assert np.abs(piston).max() < 1e-12 * np.abs(tilt).max()
    moved = [spread(model, lit.changes[3] * light, lit.cell) for light, lit in
             zip(POINTS.intensities, model.lit(POINTS, np.zeros(2)), strict=True)]  # fmt: skip
    # Z2 = 2 ρ cos θ: one wave rms moves a point by -2 λ/NA along x.
    assert off(tilt, -2 * 525e-9 / 0.5 * sum(moved)) < 1e-9


def test_light_beside_the_sensor_is_cut():
    beside = lg.Points(np.array([[0.0, 17e-6, 2e-6], [0.0, 90e-6, 2e-6]]), np.ones(2))
    inside = lg.Points(np.array([[0.0, 0.0, 2e-6]]), np.ones(1))
    model = images(terms=())
    found = [
        model.forward(lg.Points(beside.positions[k : k + 1], np.ones(1)), np.zeros(0)).sum() for k in (0, 1)
    ]
    assert 0.01 < found[0] / model.forward(inside, np.zeros(0)).sum() < 0.6
    assert found[1] == 0


@pytest.mark.parametrize(
    ("scope", "terms", "message"),
    [
        (SCOPE.replace(objective={"model": "rays"}), (4,), "model 'rays' has no phase"),
        (SCOPE, (4, 4), r"terms are \(4, 4\) but each"),
        (SCOPE, (0,), "Noll's index is 0"),
        (lg.LightFieldMicroscope.from_catalogue("lfm-fourier"), (4,), "configuration '1.0' or '2.0'"),
    ],
)
def test_what_has_no_such_derivatives_is_refused(scope, terms, message):
    with pytest.raises(lg.GeometryError, match=message):
        scope.pupil_images(terms)


@pytest.mark.parametrize("c", [np.zeros(3), np.array([np.nan])])
def test_coefficients_that_are_not_one_number_for_each_term_are_refused(c):
    with pytest.raises(lg.GeometryError, match="coefficients"):
        images(terms=(4,)).forward(POINTS, c)


def test_weights_of_another_picture_are_refused():
    with pytest.raises(lg.GeometryError, match=r"weights have shape \(3, 3\)"):
        images(terms=(4,)).gradient(POINTS, np.zeros(1), np.zeros((3, 3)))
