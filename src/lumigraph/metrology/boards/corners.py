"""The board and its corners on raw images."""

import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from lumigraph.core import checks
from lumigraph.core.short_repr import brief
from lumigraph.errors import CalibrationError, FormatError
from lumigraph.metrology.boards.noise import centred, sums
from lumigraph.metrology.boards.spill import Spill
from lumigraph.units import parse

if TYPE_CHECKING:
    from lumigraph.metrology.boards.camera import MetricCamera

_BOARD = re.compile(r"(\d{1,4})\s*[x×]\s*(\d{1,4})\s*(corners|dots|asymmetric dots|charuco|)")
_PART = re.compile(r"(dots|markers)\s+(.+)|(DICT_\w+)")

_WRITTEN = (
    "'9 x 5 corners, 10 mm', '11 x 4 dots, 10 mm, dots 4 mm', '4 x 11 asymmetric dots, 10 mm' or "
    "'9 x 6 charuco, 10 mm, markers 7 mm, DICT_4X4_50'"
)

PATTERNS = ("corners", "dots", "asymmetric dots", "charuco")
"""Patterns of boards.

- corners: the inner ones of a chessboard
- dots: dark ones on a white ground, on a square lattice
- asymmetric dots: in rows that are `spacing` apart; dots in a row are twice that apart, and every second row
  begins `spacing` farther to the right
- charuco: the inner corners of a chessboard with a marker in each white square
"""

LEAST = 3
"""Corners along either side of a board."""

FARTHEST = 1e6
"""Coordinate beyond all pictures [px]."""

_COLUMNS = ("frame", "corner", "place", "center", "kind")


@dataclass(frozen=True, slots=True)
class Board:
    """A plane with corners or dots on a lattice, such as the inner corners of a chessboard.

    Parameters
    ----------
    shape
        Corners or dots down and across.
    spacing
        Between neighbours, or between rows of asymmetric dots [m].
    pattern
        One of `PATTERNS`.
    size
        Diameter of the dots, or width of the markers [m]; None for dots half as wide as their spacing.
    dictionary
        Of the markers, by OpenCV's name, such as DICT_4X4_50.
    heights
        Of all corners over the plane, away from the camera [m], of a board that is not flat: `board`
        measures them. None for a flat one.

    Raises
    ------
    GeometryError
        A spacing or size that is not above 0.
    CalibrationError
        Fewer than three corners along a side, another pattern, markers without size or dictionary, dots or
        markers that do not fit.

    Examples
    --------
    >>> board = Board.from_text("9 x 5 corners, 10 mm")
    >>> board.shape, board.spacing
    ((5, 9), 0.01)
    >>> Board.from_text("9 x 6 charuco, 10 mm, markers 7 mm, DICT_4X4_50").dictionary
    'DICT_4X4_50'
    """

    shape: tuple[int, int]
    spacing: float
    pattern: str = "corners"
    size: float | None = None
    dictionary: str | None = None
    heights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        if min(self.shape) < LEAST:
            raise CalibrationError(
                f"the board has {self.shape[0]} x {self.shape[1]} corners but needs {LEAST} along each side."
            )
        object.__setattr__(self, "spacing", checks.positive("spacing", self.spacing))
        if self.pattern not in PATTERNS:
            raise CalibrationError(
                f"the pattern is {self.pattern!r} but must be one of {', '.join(PATTERNS)}."
            )
        self._check_size()
        count = self.shape[0] * self.shape[1]
        if self.heights is not None and len(self.heights) != count:
            raise CalibrationError(f"the board has {len(self.heights)} heights but {count} corners.")
        for height in self.heights or ():
            checks.finite("heights", height, "m")

    def _check_size(self) -> None:
        charuco = self.pattern == "charuco"
        if charuco != (self.dictionary is not None) or (charuco and self.size is None):
            raise CalibrationError(
                "a ChArUco board, and no other, has markers of a dictionary; give both the width of its "
                "markers and the dictionary, such as 'markers 7 mm, DICT_4X4_50'."
            )
        if self.size is None:
            return
        object.__setattr__(self, "size", checks.positive("size", self.size))
        if self.pattern == "corners":
            raise CalibrationError("a chessboard has neither dots nor markers, whose size was given.")
        most = self.spacing * (math.sqrt(2) if self.pattern == "asymmetric dots" else 1)
        if self.size >= most:
            raise CalibrationError(
                f"dots or markers {self.size * 1e3:.4g} mm wide do not fit side by side, "
                f"{most * 1e3:.4g} mm apart."
            )

    @classmethod
    def from_text(cls, text: str) -> "Board":
        """Board from text such as "9 x 5 corners, 10 mm": across, down, spacing, and parts by pattern.

        Raises
        ------
        FormatError
            Other text, or a length without a unit.
        """
        first, *rest = (one.strip() for one in text.split(","))
        found, parts = _BOARD.fullmatch(first), [_PART.fullmatch(one) for one in rest[1:]]
        if found is None or not rest or None in parts:
            raise FormatError(f"the board is {text!r} but must be written as {_WRITTEN}.")
        sizes = {one[1]: parse(one[2]) for one in parts if one and one[1]}
        names = [one[3] for one in parts if one and one[3]]
        pattern = found[3] or "corners"
        if sizes.keys() - {"markers" if pattern == "charuco" else "dots"} or len(parts) > 2 or len(names) > 1:
            raise FormatError(f"the board is {text!r} but must be written as {_WRITTEN}.")
        return cls(
            (int(found[2]), int(found[1])), parse(rest[0]), pattern,
            next(iter(sizes.values()), None), next(iter(names), None),
        )  # fmt: skip

    @property
    def radius(self) -> float:
        """Radius of the dots [m]; 0 for corners, which have none."""
        if self.pattern not in ("dots", "asymmetric dots"):
            return 0.0
        return (self.spacing / 2 if self.size is None else self.size) / 2

    @property
    def text(self) -> str:
        """Text of the board, as `from_text` takes it.

        >>> Board.from_text("9 x 6 charuco, 10 mm, markers 7 mm, DICT_4X4_50").text
        '9 x 6 charuco, 10 mm, markers 7 mm, DICT_4X4_50'
        """
        down, across = self.shape
        words = [f"{across} x {down} {self.pattern}", f"{self.spacing * 1e3:.10g} mm"]
        if self.size is not None:
            words.append(f"{'markers' if self.dictionary else 'dots'} {self.size * 1e3:.10g} mm")
        return ", ".join([*words, *([self.dictionary] if self.dictionary else [])])

    @property
    def what(self) -> str:
        """Description in words, such as "chessboard of 9 x 5 inner corners"."""
        down, across = self.shape
        inner = f"{across} x {down} inner corners"
        return {
            "corners": f"chessboard of {inner} with a white margin",
            "charuco": f"ChArUco board of {inner} ({across + 1} x {down + 1} squares), {self.dictionary}",
        }.get(self.pattern, f"board of {across} x {down} {self.pattern}")

    def points(self) -> np.ndarray:
        """Corners or dots (n, 3) as (z, y, x) [m], row by row, in the board's own frame: z = 0 if flat."""
        y, x = np.mgrid[: self.shape[0], : self.shape[1]].reshape(2, -1)
        if self.pattern == "asymmetric dots":
            x = 2 * x + y % 2
        z = np.zeros(y.size) if self.heights is None else np.array(self.heights)
        return np.stack([z, y * self.spacing, x * self.spacing], axis=1)

    @property
    def diagonal(self) -> float:
        """Length from the first point to the last [m]."""
        return float(np.hypot(*np.ptp(self.points()[:, 1:], axis=0)))

    @property
    def middle(self) -> np.ndarray:
        """Middle of the points (3,), (z, y, x) [m]."""
        points = self.points()
        return (points.min(0) + points.max(0)) / 2


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of a board as lenslets show them: n places on upright raw images.

    Parameters
    ----------
    frame
        (n,) Picture that each belongs to: any whole numbers.
    corner
        (n,) Of the board, counted row by row from 0.
    place
        (n, 2) Where it shows (y, x) [px].
    center
        (n, 2) The micro-image's centre (y, x) [px].
    kind
        (n,) Of the lenslet: 0, or 0 to 2 in arrays of three focal lengths.
    in_views
        Whether they were found in views of a camera 1.0: then place less centre is the view, which is exact,
        and the centre is what was measured, that of a micro-image between those of two lenslets.
    spill
        The light that lenslets spread over their micro-image, and spill into their neighbours'; None if it is
        not known or taken out.

    Raises
    ------
    CalibrationError
        Columns of different lengths, none at all, negative corners or kinds, places off every picture.
    LumigraphError
        Places or centres that are not finite.
    """

    frame: np.ndarray
    corner: np.ndarray
    place: np.ndarray
    center: np.ndarray
    kind: np.ndarray
    in_views: bool = False
    spill: Spill | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in ("frame", "corner", "kind"):
            values = np.asarray(getattr(self, name))
            if values.ndim != 1 or values.dtype.kind not in "iu":
                raise CalibrationError(
                    f"{name} is {values.dtype} of shape {values.shape} but must be (n,), integers."
                )
            object.__setattr__(self, name, values)
        for name in ("place", "center"):
            values = np.asarray(getattr(self, name), np.float64)
            checks.finite_array(name, values, CalibrationError)
            if values.shape != (len(self), 2):
                raise CalibrationError(f"{name} has shape {values.shape} but must be ({len(self)}, 2).")
            if values.size and (most := float(np.abs(values).max())) > FARTHEST:
                raise CalibrationError(f"{name} reaches to {most:.3g} px but at most {FARTHEST:g} px.")
            object.__setattr__(self, name, values)
        if not len(self) or {len(self.corner), len(self.kind)} != {len(self)}:
            sizes = ", ".join(f"{name} {len(getattr(self, name))}" for name in _COLUMNS)
            raise CalibrationError(f"the columns have {sizes} rows but must have as many, at least one.")
        if self.corner.min() < 0 or not 0 <= self.kind.min() <= self.kind.max() <= 2:
            raise CalibrationError(
                f"corners start at {self.corner.min()}, kinds are {self.kind.min()} to {self.kind.max()}; "
                "corners must be at least 0, kinds 0 to 2."
            )

    def __len__(self) -> int:
        return int(np.shape(self.frame)[0])

    def __getitem__(self, chosen: np.ndarray) -> "Corners":
        """Some of the rows, by a mask or indices."""
        columns = (getattr(self, name)[chosen] for name in _COLUMNS)
        return Corners(*columns, in_views=self.in_views, spill=self.spill)

    def cleared(self, camera: "MetricCamera") -> "Corners":
        """Corners as they would be if this camera's lenslets spread and spilt no light."""
        if self.spill is None:
            return self
        way, width = self.place - self.center, self.spill.width(camera)
        if self.in_views:
            aside = self.spill.aside(way, self._slopes(way, self.center), width)
            return replace(self, place=self.place - aside, center=self.center - aside, spill=None)
        aside = self.spill.outwards(way, self.moved, width, self.kind)
        return replace(self, place=self.place - aside, spill=None)

    def _slopes(self, way: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """(n,) How far each one's corner moves over the way."""
        sight = self.sights()
        inner, spread = centred(way, sight)
        return (sums((inner * moved).sum(1), sight) / spread)[sight]

    @property
    def moved(self) -> np.ndarray:
        """(n,) How far micro-images of each one's corner move, over the way between their lenslets."""
        return self._slopes(self.center, self.place - self.center)

    @property
    def sharp(self) -> float:
        """`moved` of the middle one of all corners."""
        return float(np.median(self.moved))

    @property
    def way(self) -> np.ndarray | None:
        """(n, 2) From centres to places of corners in views [px]; None of others."""
        return self.place - self.center if self.in_views else None

    @property
    def frames(self) -> np.ndarray:
        """The pictures, ascending."""
        return np.unique(self.frame)

    def sights(self) -> np.ndarray:
        """(n,) One number for all places of the same corner on the same picture, counted from 0."""
        pairs = np.stack([self.frame, self.corner], axis=1)
        return np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
