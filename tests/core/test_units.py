import math

import pytest

from lumigraph.errors import FormatError
from lumigraph.units import deg, mm, nm, parse, spaced, um


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


@pytest.mark.parametrize(
    ("text", "values", "unit"),
    [
        ("-2 um:3 um:2 um", [-2, 0, 2], "um"),  # the last step would lead past the end
        ("0:20 um:x3", [0, 10, 20], "um"),
        ("4 mm:5 mm:500 um", [4, 4.5, 5], "mm"),
        ("0.9:1.1:0.1", [0.9, 1.0, 1.1], ""),
        ("1:0:-0.5", [1, 0.5, 0], ""),
        ("4 mm:6 mm:x1", [5], "mm"),
        ("1 mm:1 mm:1 mm", [1], "mm"),
    ],
)
def test_ranges_are_read_exactly(text, values, unit):
    assert spaced(text) == (values, unit)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 um:2 um", "must be first:last:step, such as"),
        ("a:b:x3", "in finite numbers"),
        ("nan mm:2 mm:x3", "in finite numbers"),
        ("1e400:2:x3", "in finite numbers"),
        ("4 mm:6 mm:9", "Write '4 mm:6 mm:x9' for a count, or '4 mm:6 mm:9 mm' for a step"),
        ("0.9:1.1:9", "Write '0.9:1.1:x9' for a count, or '0.9:1.1:9.0' for a step"),
        ("4 mm:6 deg:x3", "has the units 'deg' and 'mm'"),
        ("1:0:0.5", "its step is 0.5"),
        ("0:1:1e-400", "its step is 0"),
        ("0:1:x0", "asks for 0 values but must have 1 to 1000"),
        ("0:1:x1001", "asks for 1001 values"),
        ("0 um:1 m:1 nm", "but must have 1 to 1000"),
        ("1:2:x" + 400 * "9", "must be first:last:step"),
    ],
)
def test_ranges_of_another_form_are_refused(text, message):
    with pytest.raises(FormatError, match=message):
        spaced(text)
