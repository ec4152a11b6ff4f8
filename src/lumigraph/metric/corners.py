"""The board and its corners on raw images."""

import re
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.errors import CalibrationError, FormatError
from lumigraph.units import parse

_BOARD = re.compile(r"\s*(\d{1,4})\s*[x×]\s*(\d{1,4})\s*(?:corners)?\s*,\s*(.+)")

LEAST = 3
"""Corners along either side of a board."""

FARTHEST = 1e6
"""What no picture reaches to [px]."""

_COLUMNS = ("frame", "corner", "place", "center", "kind")


@dataclass(frozen=True, slots=True)
class Board:
    """A plane with corners on a square lattice, such as the inner ones of a chessboard.

    Parameters
    ----------
    shape
        Corners down and across.
    spacing
        Between neighbours [m].

    Raises
    ------
    GeometryError
        A spacing that is not above 0.
    CalibrationError
        Fewer than three corners along a side.

    Examples
    --------
    >>> Board.from_text("9 x 5 corners, 10 mm")
    Board(shape=(5, 9), spacing=0.01)
    """

    shape: tuple[int, int]
    spacing: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        if min(self.shape) < LEAST:
            raise CalibrationError(
                f"the board has {self.shape[0]} x {self.shape[1]} corners but needs {LEAST} along each side."
            )
        checks.positive("spacing", self.spacing)

    @classmethod
    def from_text(cls, text: str) -> "Board":
        """Of text such as "9 x 5 corners, 10 mm": across, down, spacing.

        Raises
        ------
        FormatError
            Other text, or a length without a unit.
        """
        found = _BOARD.fullmatch(text)
        if found is None:
            raise FormatError(f"the board is {text!r} but must be written as '9 x 5 corners, 10 mm'.")
        return cls((int(found[2]), int(found[1])), parse(found[3]))

    def points(self) -> np.ndarray:
        """Corners (n, 3) as (z, y, x) [m], row by row, in the board's own frame: z = 0."""
        y, x = np.mgrid[: self.shape[0], : self.shape[1]].reshape(2, -1) * self.spacing
        return np.stack([np.zeros(y.size), y, x], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Where lenslets show the corners of a board: n places on raw images that stand upright.

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
        return Corners(*(getattr(self, name)[chosen] for name in _COLUMNS), in_views=self.in_views)

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
