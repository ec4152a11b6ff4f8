"""Tables of aberrations over the field, in camera files and in files of their own."""

import math

import numpy as np
import pytest

import lumigraph as lg
from cameras import focused
from lumigraph.elements.field_plate import FieldPlate, ZernikeMap
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.over_field import read
from lumigraph.units import nm

CSV = "# a round lens\nfield [deg], Z8 [waves], Z4 [waves]\n0, 0, 0.01\n5, 0.1, 0.02\n10, 0.3, 0.05\n"


def written(tmp_path, text=CSV, name="lens.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_camera_file_names_its_table_from_where_it_stands(tmp_path):
    written(tmp_path)
    text = focused().to_toml().replace("[main_lens]\n", '[main_lens]\nover_field = "lens.csv"\n')
    camera = lg.load_camera(written(tmp_path, text, "camera.toml"))
    table = camera.main_lens.over_field
    assert table.terms == {8: (0.0, 0.1, 0.3), 4: (0.01, 0.02, 0.05)}
    assert table.field == pytest.approx([0, math.radians(5), math.radians(10)])
    assert "Noll 8, most over the field" in str(camera.describe())
    assert lg.load_camera(written(tmp_path, camera.to_toml(), "again.toml")) == camera


def test_a_table_with_rows_and_columns_and_wavelengths(tmp_path):
    lines = ["y [deg], x [deg], wavelength [nm], Z7 [nm]"]
    lines += [
        f"{y}, {x}, {w}, {y + 2 * x + w / 100}" for w in (500, 600) for y in (-1, 0, 1) for x in (-2, 2)
    ]
    table = lg.instruments.OverField(**read(written(tmp_path, "\n".join(lines))))
    found = table.aberrations.at(math.tan(math.radians(0.5)), math.tan(math.radians(-1.0)), 550 * nm)
    assert found[7] == pytest.approx((0.5 - 2 + 5.5) / 550, rel=1e-3)  # paths over the wavelength
    camera = focused().replace(main_lens={"over_field": table})
    assert type(camera).from_table(lg.io.source.toml("-", camera.to_toml())) == camera


def test_terms_of_a_round_lens_turn_with_the_field():
    values = np.array([[0.0, 0.0], [0.2, 0.1]]).reshape(1, 1, 2, 2)
    lens = ZernikeMap((8, 6), values, x=(0.0, 0.1))
    y, x = 0.1 * math.sin(0.7), 0.1 * math.cos(0.7)
    found = lens.at(y, x, 550 * nm)
    assert [found[j] for j in (8, 7)] == pytest.approx([0.2 * math.cos(0.7), 0.2 * math.sin(0.7)])
    assert [found[j] for j in (6, 5)] == pytest.approx([0.1 * math.cos(1.4), 0.1 * math.sin(1.4)])


def test_between_fields_polynomials_of_a_lens_are_exact():
    """Coma goes with the field and its cube, defocus with its square: splines of right parity hold them."""
    at = np.linspace(0, 0.2, 6)
    values = np.stack([2 * at + 30 * at**3, 0.1 - 3 * at**2], axis=-1).reshape(1, 1, 6, 2)
    lens = ZernikeMap((8, 4), values, x=tuple(at))
    for field in (0.01, 0.07, 0.19):
        found = lens.at(0.0, field, 550 * nm)
        assert found[8] == pytest.approx(2 * field + 30 * field**3, abs=1e-9)
        assert found[4] == pytest.approx(0.1 - 3 * field**2, abs=1e-9)


def test_what_all_fields_have_is_added():
    camera = focused().replace(
        main_lens={
            "aberrations": {8: 0.25},
            "over_field": {"field": [0, 0.1], "unit": "waves", "terms": {8: [0, 1]}},
        }
    )
    plate = camera.lens_train().elements[0]
    assert isinstance(plate, FieldPlate)
    assert dict(plate.at(0.0, math.tan(0.1), 550 * nm).coefficients)[8] == pytest.approx(2 * np.pi * 1.25)


def with_table(**changes):
    return focused().replace(
        main_lens={"over_field": {"field": [0, 0.1], "unit": "waves", "terms": {8: [0, 1]}, **changes}}
    )


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"field": [0.1, 0.0]}, "must be finite and ascend"),
        ({"field": [0.05, 0.1]}, "must be 0, the axis"),
        ({"field": [0, 1.5]}, "too far from the axis"),
        ({"field": []}, "is not a list"),
        ({"terms": {8: [0.5, 1]}}, "Noll term 8 is 0.5 on the axis"),
        ({"terms": {7: [0, 1]}}, "Noll term 7 is 1 where the field lies along x"),
        ({"terms": {8: [0, math.nan]}}, "is not a finite number"),
        ({"terms": {8: [0, 1, 2]}}, "3 values but there are 2 fields"),
        ({"terms": {8: [0, 2000]}}, "at most 1000"),
        ({"terms": {0: [0, 1]}}, "is not a Noll index"),
        ({"terms": {}}, "terms is empty"),
        ({"terms": 3}, "is not a table"),
        ({"unit": "mm"}, "'mm' is not"),
        ({"y": [0, 0.1]}, "write field, of a round lens, or both y and x"),
        ({"x": [0, 0.1]}, "write field, of a round lens, or both y and x"),
        ({"wavelengths": [0.0]}, "not above zero"),
    ],
)
def test_wrong_tables_are_one_line_that_names_them(changes, match):
    with pytest.raises((FormatError, GeometryError), match=f"^main_lens.over_field.*{match}"):
        with_table(**changes)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "has no rows"),
        ("field [deg], Z8 [waves]\n", "has no rows"),
        ("field, Z8 [waves]\n0, 1\n", "has a column 'field'"),
        ("field [deg], Z8 [mm]\n0, 1\n", "has a column 'Z8"),
        ("field [deg], Z8 [nm], Z4 [um]\n0, 1, 2\n", "in one unit"),
        ("field [deg]\n0\n", "no unit"),
        ("field [deg], Z4 [nm]\n0, abc\n", "row 1: '0,  abc' is not 2 finite"),
        ("field [deg], Z4 [nm]\n0, inf\n", "row 1"),
        ("field [deg], Z4 [nm]\n0, 1\n0, 2\n", "has field 0 twice"),
        ("y [deg], x [deg], Z4 [nm]\n0, 0, 1\n1, 1, 1\n", "Give a row for each"),
        ("field [deg], Z4 [nm]\n0\n", "row 1"),
    ],
)
def test_wrong_files_are_one_line_that_names_them(tmp_path, text, match):
    with pytest.raises((FormatError, GeometryError), match=match):
        read(written(tmp_path, text))


def test_no_file_binary_files_and_huge_ones_are_refused(tmp_path):
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "huge.csv").write_bytes(b"1," * 2**22)
    for name, match in (("none.csv", "cannot be read"), ("binary.csv", "not text"), ("huge.csv", "larger")):
        with pytest.raises(FormatError, match=match):
            read(tmp_path / name)


def test_a_wavelength_beyond_the_table_is_refused():
    camera = with_table(wavelengths=["500 nm", "600 nm"], terms={8: [0, 1, 0, 1]}).replace(
        wavelength="633 nm"
    )
    with pytest.raises(GeometryError, match=r"wavelength is 633 nm .* from 500 to 600 nm"):
        lg.simulate(camera, lg.targets.points([(0.0, 0.0)]))


@pytest.mark.parametrize(
    ("unit", "path"),
    [("waves", 550e-9), ("nm", 1e-9), ("um", 1e-6), ("m", 1.0)],
    ids=["waves", "nm", "um", "m"],
)
def test_one_table_in_each_unit_is_described_in_waves_and_aberrates_alike(unit, path):
    """A quarter of a wave at 550 nm."""
    camera = with_table(unit=unit, terms={8: [0, 0.25 * 550e-9 / path]}).replace(wavelength="550 nm")
    rows = {row.name: row.value for row in camera.quantities()}
    assert rows["Noll 8, most over the field"] == pytest.approx(0.25, rel=1e-9)
    assert camera.main_lens.over_field.aberrations.at(0.0, math.tan(0.1), 550e-9)[8] == pytest.approx(0.25)


@pytest.mark.parametrize("unit", ["waves", "nm", "um", "m"])
@pytest.mark.parametrize("size", [1e-9, 1.0, 100.0])
def test_what_no_round_lens_has_is_refused_beside_terms_of_any_size_and_unit(unit, size):
    """By one part in a million of the largest term: 2e-6 is refused, 0.5e-6 is rounding."""
    allowed = with_table(unit=unit, terms={8: [0.5e-6 * size, size]})
    assert allowed.main_lens.over_field.terms[8][1] == size
    with pytest.raises(GeometryError, match=r"Noll term 8 is .* on the axis, where no round lens has it"):
        with_table(unit=unit, terms={8: [2e-6 * size, size]})
