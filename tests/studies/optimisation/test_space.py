"""What varies in a search: where a camera itself stands in it, in whatever unit; values of lists."""

import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.studies.optimisation.space import Space

SCOPE, CAMERA = "lfm-fourier", "thesis-plenoptic-2-m050"


@pytest.mark.parametrize(
    ("vary", "own"),
    [
        ({"fourier_lens": "0.05 m:0.1 m:x2"}, {"fourier_lens": "0.075 m"}),
        ({"fourier_lens": "50 mm, 75000 um"}, {"fourier_lens": "75000 um"}),
        ({"fourier_lens": "80 mm:100 mm:x2"}, None),
        ({"fourier_lens": "50 mm, 60 mm"}, None),
        ({"lenslets.single.1,2.focal_change": "0:0.1:x2"}, None),
        ({"objective.numerical_aperture": "0.3:0.6:x2"}, {"objective.numerical_aperture": 0.5}),
    ],
)
def test_a_cameras_own_values_are_known_within_ranges(vary, own):
    assert Space.of(vary).own(lg.load_camera(SCOPE)) == own


def test_a_cameras_own_angles_are_known_in_the_unit_of_a_range():
    """Its file has them in rad."""
    tilted = lg.load_camera(CAMERA).replace(built={"array_tilt": ("2 mrad", "0 mrad")})
    own = Space.of({"built.array_tilt.0": "-4 mrad:4 mrad:x3"}).own(tilted)
    assert own == {"built.array_tilt.0": "2 mrad"}


def test_the_verb_varies_an_angle_of_a_pair_that_the_file_leaves_out(tmp_path):
    best = tmp_path / "best.toml"
    words = ["--vary", "built.array_tilt.1=1 mrad:2 mrad:x2", "--goal", "largest views per axis"]
    assert main(["optimise", CAMERA, *words, "--search", "grid", "-o", str(best)]) == 0
    assert lg.load_camera(best).built.array_tilt == (0.0, 0.001)
