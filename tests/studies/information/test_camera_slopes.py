"""Derivatives of bounds by the parts of cameras with lenslets, beside central differences of bounds."""

import json

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.errors import GeometryError
from lumigraph.studies.information import Light, slopes
from lumigraph.studies.information.followed import followed
from lumigraph.studies.information.points import collected, source, spread
from lumigraph.units import mm, nm, um

DEPTHS, LIGHT = (3 * mm, -4 * mm), Light(20_000, 0.2)
TWO = {
    "object_distance": 120 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 60 * mm, "diameter": 2.5 * mm, "aberrations": {4: 0.1, 6: 0.3}},
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": 5.2 * mm, "count": (7, 7), "magnification": 0.5,
        "fill_factor": 0.95,
    },
    "sensor": {"pixel_pitch": 6 * um, "fill_factor": 0.9},
}  # fmt: skip
FREE = TWO | {"built": {"separation": 121 * mm, "lenslet_distance": 8 * mm}}
TURNED = TWO | {"lenslets": TWO["lenslets"] | {"rotation": 0.03}}
HEX = TWO | {
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": (5.2 * mm, 5.0 * mm, 5.4 * mm), "count": (6, 5),
        "magnification": 0.5, "layout": "hex",
    },
}  # fmt: skip
ONE = {
    "object_distance": 240 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 120 * mm},
    "lenslets": {"pitch": 0.3 * mm, "focal_length": 12 * mm, "count": (7, 7)},
    "sensor": {"pixel_pitch": 20 * um},
}
"""Whose main lens is matched to the lenslets, and so the light to their pitch."""
DIFFER = TWO | {
    "lenslets": TWO["lenslets"] | {"index": 1.5},
    "built": {
        "focal_length_scatter": 0.02, "decentre_scatter": 2 * um, "tilt_scatter": 1e-3, "form_scatter": 3e-8,
        "missing": 0.05, "seed": 3,
    },
}  # fmt: skip
OWN = TWO | {
    "lenslets": TWO["lenslets"] | {
        "single": {
            25: {"focal_change": 0.02, "offset_y": 2 * um}, 32: {"decentre_x": 10 * um},
            24: {"offset_x": 3 * um},
        },
    },
}  # fmt: skip
"""Lenslets of their own, amid the array and beside."""
BESIDE = range(1, 2)
"""A place off the axis, which moves with the lattice."""
KEYS = (
    "object_distance", "wavelength", "main_lens.focal_length", "main_lens.diameter",
    "main_lens.aberrations.6", "lenslets.pitch", "lenslets.focal_length", "lenslets.magnification",
    "lenslets.fill_factor", "sensor.pixel_pitch", "sensor.fill_factor",
)  # fmt: skip
SIZES = tuple(f"built.{key}" for key in DIFFER["built"] if key.endswith("scatter"))


def camera(given):
    of = lg.PlenopticCamera if given is ONE or "magnification" not in given["lenslets"] else None
    return (of or lg.FocusedPlenopticCamera)(**given)


def moved(given, key, by):
    """The description with one number that is so much larger, relative."""
    first, _, rest = key.partition(".")
    first = int(first) if first.isdigit() else first
    if isinstance(given, tuple):
        return (*given[:first], given[first] * (1 + by), *given[first + 1 :])
    return given | {first: moved(given[first], rest, by) if rest else given[first] * (1 + by)}


def ends(given, key, step):
    return camera(moved(given, key, -step)), camera(moved(given, key, step))


@pytest.mark.parametrize(
    ("given", "keys", "name"),
    [
        (TWO, KEYS, "depth"),
        (FREE, ("built.lenslet_distance",), "lateral"),
        pytest.param(HEX, ("lenslets.pitch", "lenslets.focal_length.1"), "lateral", marks=pytest.mark.long),
        (ONE, ("lenslets.pitch", "object_distance"), "brightness"),
        pytest.param(DIFFER, ("built.form_scatter",), "depth", marks=pytest.mark.long),
        pytest.param(
            OWN,
            ("lenslets.single.25.focal_change", "lenslets.single.24.offset_x"),
            "depth",
            marks=pytest.mark.long,
        ),
        pytest.param(DIFFER, (*KEYS[1:9:3], *SIZES), "lateral", marks=pytest.mark.long),
    ],
    ids=[
        "squares",
        "built",
        "hexagons of three kinds",
        "1.0",
        "that differ",
        "own",
        "that differ, by others",
    ],
)
def test_slopes_are_central_differences_of_bounds(given, keys, name):
    """Of cameras twice as far to either side, each sampled as it asks for, in double precision."""
    step, one, depths = 1e-6, camera(given), DEPTHS if given is ONE else DEPTHS[:1]
    found = slopes(one, [ends(given, key, step) for key in keys], depths, LIGHT, name=name, places=BESIDE)

    def bound(end):
        light = Light(LIGHT.photons * collected(end) / collected(one), LIGHT.background)
        return slopes(end, [], depths, light, name=name, places=BESIDE).bound

    for key, change in zip(keys, found.changes, strict=True):
        low, high = map(bound, ends(given, key, 2 * step))
        assert 2 * change == pytest.approx(high - low, rel=1e-4, abs=0), key


@pytest.mark.parametrize(
    "given",
    [TURNED, HEX, ONE, DIFFER, OWN],
    ids=["turned squares", "hexagons", "1.0", "that differ", "own"],
)
def test_images_and_their_derivatives_are_those_of_bounds(given):
    """Which are of single precision; behind a plain lens of a sharp stop, which is sampled here."""
    depths = np.array([-4 * mm])
    known, (found,) = source(camera(given), depths, 1e-2), followed(camera(given), [], depths, BESIDE, 1e-2)
    (place,) = spread(known.cell(-4 * mm), BESIDE)
    true, _ = known.lit(np.array([*place, -4 * mm]), checked=False)
    off = np.linalg.norm(found.lit(0)[0] - true, axis=(1, 2)) / np.linalg.norm(true, axis=(1, 2))
    assert off.max() < (5e-3 if given is ONE else 1e-5)


@pytest.mark.parametrize(
    "change",
    [{"sensor": {"read_noise": 1.0}}, {"sensor": {"full_well": 5e3}}, {"lenslets": {"count": (7, 6)}}],
)
def test_what_has_no_derivatives_is_refused(change):
    with pytest.raises(GeometryError, match="Use search 'local'"):
        slopes(camera(TWO), [(camera(TWO), camera(TWO).replace(**change))], DEPTHS, LIGHT)


def test_the_command_goes_downhill_along_them(tmp_path, capsys):
    """Two keys, five cameras: to a wider stop, which gathers more light and tells depths better."""
    file, best = tmp_path / "camera.toml", tmp_path / "best.toml"
    file.write_text(camera(TWO).to_toml())
    words = ["--vary", "main_lens.aberrations.6=0:1:x1", "--vary", "main_lens.diameter=2 mm:3 mm:x1"]
    words += ["--depth", "-4 mm", "--places", "1", "--search", "gradient", "--evaluations", "3"]
    assert main(["optimise", str(file), *words, "-o", str(best), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["best"]["depth"] < 0.95 * told["start"]["depth"]
    assert lg.load_camera(best).pupil_diameter > 2.6 * mm
