"""Table 6.1: the laboratory camera's distances, f-numbers and cut-offs, every cell."""

import math
from decimal import Decimal

from lumigraph.design import plenoptic2, resolution
from lumigraph.plots.curves import curves
from lumigraph.studies.thesis.figures._lenslet import measured
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_FOCAL, _PITCH, _WAVELENGTH = 5.2e-3, 150e-6, 633e-9

COLUMNS = ("a", "b", "NA", "F#", "ν main lens", "ν plenoptic", "c", "d")
_UNITS = ("m", "m", "", "", "1/m", "1/m", "m", "m")

PRINTED = """
0    0       0.0052  0.01442 34.6667 22785.2716 0          0.0052  0.0000
0.1  0.05720 0.00572 0.01311 38.1334 20713.8832 2071.3883  0.0057  0.0515
0.15 0.03987 0.0060  0.0125  39.8667 19813.2797 2971.9919  0.0060  0.0339
0.2  0.0312  0.0062  0.0120  41.6000 18987.7263 3797.5452  0.0062  0.0250
0.25 0.0260  0.0065  0.0116  43.3334 18228.2173 4557.0543  0.0065  0.0195
0.3  0.02253 0.0068  0.0111  45.0667 17527.1320 5258.1396  0.0068  0.0158
0.35 0.0201  0.0070  0.0107  46.8000 16877.9790 5907.2926  0.0070  0.0130
0.4  0.0182  0.0073  0.0103  48.5334 16275.1940 6510.0776  0.0073  0.0109
0.45 0.0168  0.0075  0.0099  50.2667 15713.9804 7071.2912  0.0075  0.00922
0.5  0.0156  0.0078  0.0096  52.0000 15190.1811 7595.0905  0.0078  0.0078
0.55 0.0147  0.0081  0.0093  53.7334 14700.1752 8085.0964  0.0081  0.0066
0.6  0.0139  0.0083  0.0090  55.4667 14240.7945 8544.4765  0.0083  0.00555
0.65 0.01320 0.0086  0.0087  57.2000 13809.2555 8976.0160  0.0086  0.0046
0.7  0.0126  0.0088  0.0085  58.9334 13403.1099 9382.1707  0.00884 0.0038
0.75 0.0121  0.0091  0.0082  60.6667 13020.1552 9765.1164  0.0091  0.0030
0.8  0.0117  0.0094  0.0080  62.4000 12658.4842 10126.7874 0.0094  0.0023
0.85 0.0113  0.0096  0.0078  64.1334 12316.3630 10468.9086 0.0096  0.0017
0.9  0.0110  0.0098  0.0076  65.8666 11992.2482 10733.0234 0.0099  0.0011
0.95 0.0108  0.0104  0.0074  67.6000 11684.7547 11100.5169 0.0101  0.0005
1    0.0104  0.0104  0.0072  69.3334 11392.6358 11392.6358 0.0104  0.0000
"""
"""As it stands in the thesis: the magnification, then the columns."""

MISPRINTS = {
    ("0", "a"): math.inf,
    ("0", "d"): math.inf,
    ("0.25", "NA"): 0.01154,
    ("0.7", "ν main lens"): 13403.1009,
    ("0.9", "b"): 0.00988,
    ("0.9", "ν plenoptic"): 10793.0234,
    ("0.95", "a"): 0.01067,
    ("0.95", "b"): 0.01014,
}
"""Cells whose printed value does not follow from the table's own formulas, and what does."""

_ROUNDING = {"F#": 1e-4, "ν main lens": 1e-3, "ν plenoptic": 1e-3}
"""The last digits of these columns were computed in single precision: 38.1333 is printed as 38.1334."""


@experiment(
    "table-6.1",
    "The laboratory camera",
    question="Which distances, f-numbers and cut-offs does each magnification of the laboratory camera have?",
    thesis="Table 6.1, section 6.2",
    shows="Distances, settings of two stages, f-numbers and cut-offs for magnifications from 0 to 1.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Every cell from m, f_µ = 5.2 mm, p = 150 µm and 633 nm, against the printed digits."""
    rows: list[ResultRow] = []
    lines: dict[str, list[float]] = {"main lens": [], "plenoptic": []}
    magnifications = []
    for line in PRINTED.strip().splitlines():
        text, *cells = line.split()
        found = row(float(text))
        for column, unit, cell in zip(COLUMNS, _UNITS, cells, strict=True):
            rows.append(_checked(text, column, unit, found[column], cell))
        for column in ("ν main lens", "ν plenoptic"):
            lines[column.removeprefix("ν ")].append(2 * found[column] / 1e4)
        magnifications.append(float(text))
    for m in (0.1, 0.25, 0.5, 1.0):
        rows += _by_waves(m)
    figure = curves(
        magnifications, lines, xlabel="magnification of the lenslets", ylabel="incoherent cut-off [10⁴ /m]"
    )
    return ExperimentOutcome(
        tuple(rows),
        ((figure, "Cut-offs 1/(λF#) of the main lens and m/(λF#) of the plenoptic picture."),),
        why="The table's cut-offs are coherent, 1/(2λF#); all other chapters use the incoherent 1/(λF#), "
        f"shown beside them. {len(MISPRINTS)} cells are misprints, marked as such; at m = 0 a is infinite.",
    )


def _by_waves(m: float) -> list[ResultRow]:
    """The incoherent cut-offs behind a simulated lenslet: twice those of the table."""
    printed = next(line.split() for line in PRINTED.strip().splitlines() if float(line.split()[0]) == m)
    main, plenoptic = (float(printed[1 + COLUMNS.index(f"ν {name}")]) for name in ("main lens", "plenoptic"))
    cells = row(m)
    found = measured(cells["a"], cells["b"], _WAVELENGTH)[1]
    return [
        ResultRow(
            f"m = {m:g}: incoherent ν {name}, of a wave",
            value,
            "1/m",
            printed,
            2 * printed,
            0.02 * printed,
            "twice the printed, coherent one; from the MTF of a simulated lenslet's image",
        )
        for name, value, printed in (("main lens", found / m, main), ("plenoptic", found, plenoptic))
    ]


def row(magnification: float) -> dict[str, float]:
    """Columns of the table for one magnification; a and d are infinite at 0 [m, 1/m]."""
    # At m = 0 the lenslets image infinity: the sensor is in their focal plane.
    b = plenoptic2.lenslet_distance(_FOCAL, magnification) if magnification else _FOCAL
    a = b / magnification if magnification else math.inf
    f_number = resolution.f_number(b, _PITCH)
    main = resolution.coherent_cutoff(_WAVELENGTH, f_number)
    values = (a, b, resolution.numerical_aperture(f_number), f_number, main, magnification * main, b, a - b)
    return dict(zip(COLUMNS, values, strict=True))


def _checked(text: str, column: str, unit: str, got: float, cell: str) -> ResultRow:
    """A cell that must agree with the printed digits, or with what is right where they are wrong."""
    right = MISPRINTS.get((text, column))
    name = f"m = {text}: {column}"
    if right == math.inf:
        return ResultRow(
            f"{name}, inverse",
            1 / got,
            "1/m",
            f"{column} = {cell}",
            0.0,
            0.0,
            "misprint: infinite",
            "closed form",
        )
    if right is not None:
        tolerance = max(_half_digit(str(right)), _ROUNDING.get(column, 0.0))
        return ResultRow(name, got, unit, float(cell), right, tolerance, "misprint", "closed form")
    tolerance = max(_half_digit(cell), _ROUNDING.get(column, 0.0))
    return ResultRow(name, got, unit, float(cell), float(cell), tolerance, kind="closed form")


def _half_digit(text: str) -> float:
    """Half a unit of the last digit, and a little for values that lie just on it."""
    return 0.5000001 * 10.0 ** int(Decimal(text).as_tuple().exponent)
