"""Stability over days: drift of the lattice and of the light, from white images whose files are dated."""

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np
from scipy.stats import t as student

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.core.result import Quantity
from lumigraph.errors import CalibrationError
from lumigraph.metrology.boards.places import places
from lumigraph.metrology.datasheet.exposures import FileExposures
from lumigraph.metrology.datasheet.sheet import SheetEntry

SECTION = "Stability"

LEAST_DAYS = 3
"""Dates of which a drift has an interval."""

_DATE = re.compile(r"(?<!\d)(\d{4})-?(\d\d)-?(\d\d)(?:[T_-]?(\d\d)[-:]?(\d\d))?(?!\d)")

_QUANTITIES = (
    ("drift_y", "px/day", 1.0),
    ("drift_x", "px/day", 1.0),
    ("drift_of_pitch", "ppm/day", 1e6),
    ("drift_of_rotation", "mrad/day", 1e3),
    ("drift_of_light", "%/day", 100.0),
)


def date_in(name: str) -> datetime | None:
    """Date, and time if any, that a file's name holds; None where there is none.

    Examples
    --------
    >>> print(date_in("white-2024-05-03.png"), date_in("white_20240503T1430.tiff"), date_in("white-12.png"))
    2024-05-03 00:00:00 2024-05-03 14:30:00 None
    """
    for found in _DATE.finditer(name):
        try:
            year, month, day, hour, minute = (int(part or 0) for part in found.groups())
            return datetime(year, month, day, hour, minute)
        except ValueError:  # digits that are no date
            continue
    return None


def stability(
    whites: Sequence[RawImage], lattice: Calibration, dates: Sequence[datetime | None] | None = None
) -> list[SheetEntry]:
    """Entries of drift per day, by straight lines through all days; none where images are not dated.

    Light is the mean of the images, so that the lamp's own drift is in it. What happens between two images of
    a day, or is no straight line, widens the 95 % intervals; scatter about the line is given, too.

    Parameters
    ----------
    whites
        White images of one camera at one exposure.
    lattice
        Of their mean.
    dates
        Of the images; those in the names of their files where left out.
    """
    if dates is None:
        dates = [date_in(path.name) for path in whites.paths] if isinstance(whites, FileExposures) else []
    dated = [(when, k) for k, when in enumerate(dates) if when is not None]
    count = len({when for when, _ in dated})
    if count < 2:
        return []
    if count < LEAST_DAYS:
        why = f"the white images have {count} dates, but a drift needs {LEAST_DAYS}"
        return [SheetEntry(SECTION, Quantity(name, None), why) for name, *_ in _QUANTITIES]
    first = min(when for when, _ in dated)
    days = np.array([(when - first).total_seconds() / 86400 for when, _ in dated])
    try:
        found = np.array([_state(whites[k], lattice) for _, k in dated])
    except CalibrationError as error:
        return [SheetEntry(SECTION, Quantity(name, None), str(error)) for name, *_ in _QUANTITIES]
    return [
        _entry(name, unit, days, scale * values)
        for (name, unit, scale), values in zip(_QUANTITIES, found.T, strict=True)
    ]


def _state(white: RawImage, lattice: Calibration) -> tuple[float, ...]:
    """Offset (y, x) of the lenslet in the middle [px], relative pitch, rotation [rad], mean light."""
    data = np.asarray(to_numpy(white.data), float)
    found, middle = places(data, lattice).lattice, (np.array(data.shape[:2]) - 1) / 2
    basis, origin = np.array(lattice.lattice.basis), np.array(lattice.lattice.origin)
    nearest = np.rint(np.linalg.solve(basis.T, middle - origin))
    y, x = np.array(found.origin) + nearest @ np.array(found.basis) - origin - nearest @ basis
    return float(y), float(x), found.pitch / lattice.lattice.pitch, found.rotation, float(data.mean())


def _entry(name: str, unit: str, days: np.ndarray, values: np.ndarray) -> SheetEntry:
    """Slope of values over days, with its 95 % interval by the scatter about the line."""
    if name == "drift_of_light":
        values = values / (values.mean() / 100)
    design = np.column_stack([days - days.mean(), np.ones_like(days)])
    fit, *_ = np.linalg.lstsq(design, values, rcond=None)
    scatter = float(np.sqrt(np.sum((values - design @ fit) ** 2) / (len(days) - 2)))
    half = float(student.ppf(0.975, len(days) - 2)) * scatter / float(np.sqrt(np.sum(design[:, 0] ** 2)))
    how = (
        f"straight line through {len(days)} white images over {np.ptp(days):.3g} days; scatter about it "
        f"{scatter:.2g} {unit.split('/')[0]}"
    )
    slope = float(fit[0])
    return SheetEntry(SECTION, Quantity(name, slope, unit, (slope - half, slope + half)), how)
