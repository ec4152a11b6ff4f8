"""Chapters 1 and 4 at reduced size: every row that expects a number gets it."""

import numpy as np
import pytest

from lumigraph.rendering import decode
from lumigraph.studies.thesis import Context, ResultRow, experiments, find
from lumigraph.studies.thesis.figures import figure_4_8, figure_4_12, table_4_1, table_4_2
from lumigraph.units import mm

IDS = [one.id for one in experiments() if one.id.split("-")[-1].split(".")[0] in ("1", "4")]


def test_both_chapters_are_there():
    assert {"figure-1.12", "figure-1.20", "figure-1.25", "table-4.2", "figure-4.20"} <= set(IDS)
    assert len(IDS) == 14


SLOW = ("table-4.2", "figure-1.20", "figure-4.8", "figure-4.12")  # 10 s and more: run at full size alone


@pytest.mark.parametrize("name", [name for name in IDS if name not in SLOW])
def test_all_rows_pass_at_reduced_size(name, monkeypatch):
    monkeypatch.delenv("LUMIGRAPH_DATA", raising=False)
    (one,) = find([name])
    outcome = one.run(Context(quick=True))
    assert outcome.figures
    assert outcome.why
    checked = [row for row in outcome.rows if row.passed is not None]
    assert len(checked) >= 2
    assert [(row.quantity, row.got, row.expected) for row in checked if not row.passed] == []


def test_real_letters_are_a_row_and_a_figure_where_there_are_some(monkeypatch, tmp_path):
    (one,) = find(["figure-4.8"])
    drawn = [ResultRow("simulated", 1.0)]
    for name, stub in (("_aperture_rows", drawn), ("_view_rows", drawn), ("_scene_views", None)):
        monkeypatch.setattr(figure_4_8, name, lambda *_, stub=stub: stub)
    monkeypatch.setattr(figure_4_8, "_figure", lambda views, what: (views, what))
    monkeypatch.setattr(table_4_1, "point", lambda camera, dz: np.zeros(camera.sensor.shape))
    asked = []
    monkeypatch.setattr(figure_4_8, "_real_views", lambda folder: asked.append(folder) or (None, 297.4e-6))
    monkeypatch.delenv("LUMIGRAPH_DATA", raising=False)
    without = one.run(Context(quick=True))
    monkeypatch.setenv("LUMIGRAPH_DATA", str(tmp_path))
    folder = tmp_path / "letters_plenoptic1"
    folder.mkdir()
    (folder / "letters_ULF_M1.png").touch()
    half = one.run(Context(quick=True))
    assert not asked  # its white image is missing
    (folder / "letters_ULF_M1_white.png").touch()
    there = one.run(Context(quick=True))
    assert asked == [folder]
    assert [len(found.rows) for found in (without, half, there)] == [2, 2, 3]
    assert [len(found.figures) for found in (without, half, there)] == [1, 1, 2]
    assert (there.rows[-1].quantity, there.rows[-1].passed) == ("real camera, lenslet pitch", True)
    assert there.rows[-1].got == pytest.approx(297.4)


def test_energies_share_out_all_light():
    camera = table_4_1.camera(Context(quick=True), (9, 9))
    raw = table_4_1.point(camera)
    share = table_4_1.energies(raw, camera.calibration, 4)
    # Micro-images tile the plane: only what falls beyond the ninth lenslet is missing.
    assert share.sum() == pytest.approx(1, abs=0.005)
    np.testing.assert_allclose(share, share.T, atol=1e-4)


def test_an_airy_pattern_keeps_its_light_in_a_wide_square():
    assert table_4_1.airy_in_square(100 * 0.633e-6 * 10, 633e-9, 10) == pytest.approx(1, abs=0.01)
    assert table_4_1.airy_in_square(1e-6, 633e-9, 10) == pytest.approx(
        np.pi / 4 * 1e-12 / (633e-9 * 10) ** 2, rel=0.02
    )


def test_fixed_blocks_are_a_lenslet_wide():
    camera = table_4_1.camera(Context(quick=True))
    blocks = table_4_2.fixed_blocks(camera)
    assert blocks.lattice.pitch == pytest.approx(15)
    assert camera.calibration.lattice.pitch == pytest.approx(15.625)


def test_slope_of_a_nearer_point_is_positive():
    camera = table_4_1.camera(Context(quick=True))
    views = decode(table_4_1.point(camera, -80 * mm), camera.calibration)
    assert figure_4_12.slope(views) == pytest.approx(0.5, abs=0.03)
