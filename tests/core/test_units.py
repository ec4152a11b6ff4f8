import math

import pytest

from lumigraph.errors import FormatError
from lumigraph.units import deg, mm, nm, parse, um


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("150 um", 150 * um),
        ("150µm", 150 * um),
        ("60mm", 60 * mm),
        ("-2.5e1 nm", -25 * nm),
        ("0", 0.0),
        ("1 in", 25.4 * mm),
        ("2 Å", 0.2 * nm),
        ("3 microns", 3 * um),
        ("5\u03bcm", 5 * um),
        ("1 m", 1.0),
    ],
)
def test_lengths_become_metres(text, value):
    assert parse(text) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "value"), [("2 deg", 2 * deg), ("90°", math.pi / 2), ("5 mrad", 5e-3), ("60 arcmin", deg)]
)
def test_angles_become_radians(text, value):
    assert parse(text, "angle") == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("five mm", "'five mm' is not a quantity"),
        ("9**9**9 m", "is not a quantity"),
        ("1e999 m", "is not finite"),
        ("60", "'60' has no unit. Write a number and a unit, such as '150 um'"),
        ("60 deg", "'60 deg' is not a length"),
        ("60 parrots", "unknown unit 'parrots'"),
    ],
)
def test_what_is_not_a_length_is_refused(text, message):
    with pytest.raises(FormatError, match=message.replace("*", r"\*")):
        parse(text)


def test_a_quantity_is_the_number_nearest_to_what_is_written():
    assert parse("200 um") == 2e-4  # 200 * 1e-6 is one bit less
    for number in ("0.3", "5.2", "150", "633"):
        assert parse(f"{number} um") == float(f"{number}e-6")
        assert parse(f"{number} nm") == pytest.approx(float(number) * nm, rel=3e-16)
    assert parse("1e-999999999 m") == 0.0
