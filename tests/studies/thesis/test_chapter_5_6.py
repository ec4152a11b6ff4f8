"""Chapters 5 and 6 of the thesis, at reduced size: every row passes."""

import math

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.studies.thesis import Context, find
from lumigraph.studies.thesis.figures import table_6_1
from lumigraph.studies.thesis.figures.periodic import LinedCamera, line_spread
from lumigraph.studies.thesis.figures.point_images import camera, main_lens_camera

IDS = (
    "figure-5.3",
    "figure-5.5",
    "figure-5.7",
    "figure-5.10",
    "figure-5.11",
    "figure-5.17",
    "figure-5.21",
    "table-5.2",
    "table-5.3",
    "table-5.4",
    "table-6.1",
    "figure-6.5",
    "figure-6.6",
    "figure-6.8",
    "figure-6.10",
)


# 5 s and more: run at full size alone
SLOW = ("figure-5.3", "table-5.3", "table-5.4", "figure-5.17", "figure-6.5", "figure-6.6", "figure-6.8")


@pytest.mark.parametrize("name", [name for name in IDS if name not in SLOW])
def test_every_row_passes_at_reduced_size(name):
    (one,) = find([name])
    outcome = one.run(Context(quick=True))
    failed = [
        f"{row.quantity}: {row.got:.6g}, not {row.expected:.6g}"
        for row in outcome.rows
        if row.passed is False
    ]
    assert not failed
    assert outcome.figures or name == "table-5.2"
    assert outcome.why


def test_table_5_4_belongs_to_the_printed_number():
    assert [one.id for one in find(["5.4"])] == ["table-5.4"]


def test_table_6_1_marks_the_cells_that_do_not_follow_from_its_formulas():
    wrong = set()
    for line in table_6_1.PRINTED.strip().splitlines():
        text, *cells = line.split()
        for column, cell in zip(table_6_1.COLUMNS, cells, strict=True):
            digits = len(cell.partition(".")[2])
            found = table_6_1.row(float(text))[column]
            slack = {"F#": 1e-4, "ν main lens": 1e-3, "ν plenoptic": 1e-3}.get(column, 0.5 * 10.0**-digits)
            if not abs(found - float(cell)) <= slack * (1 + 1e-6):
                wrong.add((text, column))
    assert wrong == set(table_6_1.MISPRINTS)


@pytest.mark.long  # 20 s of points
def test_lines_behind_a_lined_camera_are_those_of_simulated_points():
    """Operator against `simulate`: a line is the sum of its points, here over one lenslet's height."""
    found = camera(0.5, 11).replace(sensor={"pixel_pitch": 150e-6 * (1 + 7.8 / 135.6) / 21})
    lined = LinedCamera.of(found, samples=21)
    period = found.lenslets.pitch * found.object_distance / found.separation
    places = (np.arange(lined.classes) - lined.classes // 2) / lined.classes * period
    x = 2 * lined.spacing
    total = 0.0
    for y in places:
        raw = lg.simulate(found, lg.targets.points([(y, x, 0.0)])).data.astype(float)
        middle = raw.shape[0] // 2
        whole = raw[middle - 94 : middle + 95, middle - 94 : middle + 95]  # nine lenslets
        total = total + whole.reshape(9, 21, 189).sum(0)
    spread = lined.spreads[lined.classes // 2 + 2]
    extra = (spread.shape[1] - 189) // 2
    spread = spread[:, extra : extra + 189] if extra >= 0 else spread
    cropped = total[:, -extra : 189 + extra] if extra < 0 else total
    assert lg_rms(cropped, spread) < 0.02


def lg_rms(image, reference):
    scale = (image * reference).sum() / (image**2).sum()
    return float(np.sqrt(((scale * image - reference) ** 2).sum() / (reference**2).sum()))


def test_an_even_object_makes_an_even_mean():
    lined = LinedCamera.of(camera(0.5, 11), samples=21)
    assert lined.raw(np.ones_like, 7).data.mean() == pytest.approx(1, abs=1e-9)


def test_moving_the_object_by_a_lenslet_moves_the_raw_image_by_a_lenslet():
    lined = LinedCamera.of(camera(0.5, 11), samples=21)
    period = lined.spacing * lined.classes

    def wave(x):
        return 0.5 + 0.5 * np.cos(2 * math.pi * 3000 * x)

    here = lined.raw(wave, 15).data
    moved = lined.raw(lambda x: wave(x - period), 15).data
    np.testing.assert_allclose(moved[:, 21:], here[:, :-21], atol=1e-9)


def test_a_line_behind_the_main_lens_has_the_transfer_function_of_a_round_pupil():
    found = camera(0.5, 11)
    x = (np.arange(2401) - 1200) * 1e-6
    spread = line_spread(main_lens_camera(found), x, found.image_distance)
    for relative in (0.25, 0.5, 0.75):
        frequency = relative / (found.wavelength * found.f_number)
        right = 2 / math.pi * (math.acos(relative) - relative * math.sqrt(1 - relative**2))
        # The tails beyond 1.2 mm are cut: half a per cent of the light.
        assert spread @ np.cos(2 * math.pi * frequency * x) == pytest.approx(right, abs=0.01)
