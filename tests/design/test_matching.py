"""Three words for the main lens' diameter, and every verb by the same."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import lumigraph as lg
from lumigraph.calibration import diagnose
from lumigraph.design import matching

PITCH, IMAGE, SEPARATION, DISTANCE = 150e-6, 0.12, 0.1356, 7.8e-3
lengths = st.floats(1e-3, 1.0)


@given(lengths, lengths, lengths)
def test_each_word_is_what_micro_images_do(z2, separation, b):
    found = matching.diameters(PITCH, z2, separation, b)
    assert z2 / found.matched == pytest.approx(b / PITCH, rel=1e-12)
    assert found.full * b / separation == pytest.approx(PITCH, rel=1e-12)
    apart = PITCH * (1 + b / separation)
    assert found.touching * b / separation == pytest.approx(apart, rel=1e-12)


def test_the_thesis_bench_has_three_diameters():
    found = matching.diameters(PITCH, IMAGE, SEPARATION, DISTANCE)
    assert found == pytest.approx((2.3077e-3, 2.6077e-3, 2.7577e-3), abs=5e-8)


def bench(word="views", diameter=None):
    lens = {} if diameter is None else {"main_lens": {"diameter": diameter}}
    return lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050").replace(
        lenslets={"count": (9, 9)}, sensor={"pixel_pitch": 5e-6}, matching=word, **lens
    )


@pytest.mark.parametrize(
    ("word", "fill"), [("views", 0.12 / 0.1434), ("full", 0.1356 / 0.1434), ("touching", 1.0)]
)
def test_no_verb_contradicts_the_camera_file(word, fill):
    camera = bench(word)
    assert camera.micro_image_fill == pytest.approx(fill, rel=1e-12)
    found = diagnose(lg.simulate(camera, lg.targets.white()), camera)
    assert found.faults == (), found.report()
    # the distance is measured by the pitch of 9 lenslets; another word is 5 % off or more
    assert found.intended_diameter == pytest.approx(camera.pupil_diameter, rel=5e-3)
    assert not [line for line in camera.describe().warnings if "main lens" in line or "overlap" in line]


def test_a_stop_unlike_the_files_is_named_by_its_own_gap():
    """The wide stop touches, as in figure 6.7, but the file's f-numbers match."""
    touching = lg.simulate(bench("touching"), lg.targets.white())
    matched = lg.simulate(bench(), lg.targets.white())
    wide, narrow = diagnose(touching, bench()), diagnose(matched, bench("touching"))
    assert wide.faults == ("wide",)
    assert (wide.diameter, wide.intended_diameter) == pytest.approx((2.758e-3, 2.308e-3), rel=1e-2)
    assert "gaps of 25.9 µm intended: close the main lens from 2.7" in wide.report()
    assert narrow.faults == ("gap",)
    assert (narrow.diameter, narrow.intended_diameter) == pytest.approx((2.308e-3, 2.758e-3), rel=1e-2)
    assert "gaps of 0.0 µm intended: open the main lens from 2." in narrow.report()


def test_a_rounded_touching_diameter_does_not_overlap():
    """2.76 mm are 0.1 % above the touching diameter: advice that was rounded brings no warning."""
    assert not [line for line in bench(diameter="2.76 mm").describe().warnings if "overlap" in line]
    assert [line for line in bench(diameter="2.8 mm").describe().warnings if "2.8 to 2.758 mm" in line]
