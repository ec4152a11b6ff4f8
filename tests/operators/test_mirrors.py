"""What is known behind the lens of one field, of fields that mirror it: against operators of their own."""

from itertools import product

import numpy as np
import pytest

from cameras import focused
from lumigraph.elements import ZernikePlate
from lumigraph.operators.lenslets import cell_images
from lumigraph.operators.periodic import incoherent, mirrors
from lumigraph.operators.periodic.incoherent import PeriodicOperator, mirrored_operator, periodic_operator
from lumigraph.operators.periodic.mirrors import SAME, Mirror
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.optics import Optics

FIELD = 1.1e-3, 1.9e-3

TABLE = {"field": ["0 deg", "0.2 deg"], "unit": "waves", "terms": {8: [0.0, 0.3], 4: [0.0, -0.1]}}


def optics_of(camera, accuracy=1e-2):
    plain = camera.optics()
    return Optics.of(plain, plain.object_distance, accuracy).bricks


def aberrated(table=TABLE, **lenslets):
    return focused(**lenslets).replace(main_lens={"over_field": table})


def raw_of(operator):
    return operator.forward(np.random.default_rng(1).random(operator.shape[1]).astype(np.float32))


def off(one, other):
    return np.linalg.norm(one - other) / np.linalg.norm(other)


def test_a_mirrored_operator_is_that_of_the_mirrored_field():
    """A quarter turn, before lenslets that are turned by 6 degrees."""
    camera, number = aberrated(rotation=0.1, count=(2, 2)), 6
    optics, grid = optics_of(camera), camera.object_grid
    turns = mirrors.turns(optics)
    assert turns == tuple(product((False, True), repeat=3))

    def of(field):
        operator = periodic_operator(field_lenses.at(camera.optics(), *field), grid, accuracy=1e-2)
        assert isinstance(operator, PeriodicOperator)
        return operator

    one, field = of(FIELD), mirrors.of_fields(turns, optics.rotation)[number] @ FIELD
    found, expected = (raw_of(each) for each in (mirrored_operator(one, turns[number]), of(field)))
    assert off(found, expected) < 2e-4  # factors are cut a little elsewhere
    assert off(raw_of(one), expected) > 2e-2


@pytest.mark.long
def test_few_lenses_are_built_and_all_of_them_agree_with_those_built_alone(monkeypatch):
    camera = aberrated({**TABLE, "terms": {8: [0.0, 0.15]}}, count=(2, 2))
    built = []
    build = incoherent.matrix
    monkeypatch.setattr(incoherent, "matrix", lambda *given: built.append(1) or build(*given))
    mirrored, few = camera.operator(accuracy=1e-2), len(built)
    monkeypatch.setattr(mirrors, "turns", lambda _: (SAME,))
    alone = camera.operator(accuracy=1e-2)
    assert 2 * few <= len(built) - few
    assert isinstance(mirrored, field_lenses.FieldOperator)
    assert few < len(mirrored.maps)
    assert mirrored.memory_bytes < alone.memory_bytes
    assert off(raw_of(mirrored), raw_of(alone)) < 1e-2


def test_what_mirrors_change_is_not_mirrored():
    """Lenslets that stand aside, rows of bricks, lenses that are not round."""
    oblong = set(mirrors.turns(optics_of(aberrated(count=(3, 4)))))
    assert oblong == {turn for turn in product((False, True), repeat=3) if not turn[0]}
    assert mirrors.turns(optics_of(aberrated(offset=(0.0, 10e-6)))) == (SAME,)
    assert mirrors.turns(optics_of(aberrated(layout="hex"))) == (SAME,)
    lens = {"y": ["-1 deg", "1 deg"], "x": ["-1 deg", "1 deg"], "unit": "waves", "terms": {8: [0, 0, 0, 0.1]}}
    assert mirrors.turns(optics_of(aberrated(lens))) == (SAME,)
    coma = aberrated().replace(main_lens={"aberrations": {7: 0.1}})
    assert mirrors.turns(optics_of(coma)) == (SAME,)
    bent = aberrated().replace(main_lens={"aberrations": {4: 0.1}})
    assert len(mirrors.turns(optics_of(bent))) == 8


def test_fields_far_aside_are_not_mirrored():
    camera = aberrated().optics()
    optics = optics_of(aberrated())
    matrices = mirrors.of_fields(mirrors.turns(optics), 0.0)
    aside = np.linspace(1e-3, 2e-3, 5)

    def image(one):
        plates = [part for part in one.lens.elements if isinstance(part, ZernikePlate)]
        return np.array([1.0, *(rms for plate in plates for rms in dict(plate.coefficients).values())])

    found = field_lenses.lenses(camera, (aside, aside), image, 1e-2, matrices)
    assert all(min(one.field) >= 1e-3 for one in found.chosen)


def test_a_mirrors_adjoint_undoes_it():
    plane = np.arange(12.0).reshape(3, 4)
    for across, up, left in product((False, True), repeat=3):
        mirror = Mirror((3, 4), (across, up, left))
        assert mirror.forward(plane).shape == mirror.shape[0]
        np.testing.assert_array_equal(mirror.adjoint(mirror.forward(plane)), plane)
    turned = Mirror((3, 4), (True, True, False)).forward(plane)
    np.testing.assert_array_equal(turned, np.rot90(plane))


def test_light_that_is_even_along_one_axis_is_computed_for_one_side(monkeypatch):
    camera = focused(count=(2, 2)).replace(main_lens={"aberrations": {8: 0.15}})
    optics = camera.optics()

    def raw():
        return raw_of(periodic_operator(optics, camera.object_grid, accuracy=1e-2))

    found = raw()
    monkeypatch.setattr(cell_images.LensletPlaneWave, "even", (False, False))
    monkeypatch.setattr(incoherent, "matrix", lambda of, *_: periodic_matrix(of))
    assert off(found, raw()) < 2e-4


def periodic_matrix(optics):
    """Built anew, whatever is known."""
    from lumigraph.operators.periodic import kernels

    return kernels._unpacked(kernels._build(optics), optics)
