"""Charts to print, in true size: boards, a slanted edge, a Siemens star, USAF-1951, a texture."""

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.errors import FormatError, GeometryError
from lumigraph.metric.chessboard import markers
from lumigraph.metric.corners import Board
from lumigraph.scene.targets import texture
from lumigraph.scene.usaf import usaf_elements
from lumigraph.units import parse

if TYPE_CHECKING:
    from lumigraph.plots.axes import Drawing
    from lumigraph.scene import Slice

PAPERS = {
    "A4": (0.210, 0.297), "A3": (0.297, 0.420), "A2": (0.420, 0.594), "letter": (0.2159, 0.2794),
}  # fmt: skip
"""Short and long side [m]."""

EDGE_TURN = math.radians(5)
"""Angle of a slanted edge: ISO 12233."""

SPOKES = 36

GROUPS = (-2, 1)
"""Groups of USAF-1951: 0.25 to 3.56 line pairs per millimetre, which printers resolve."""

ROUND = 240
"""Corners of the polygons that are printed for circles: 0.01 % of their radius off."""

KINDS = ("edge", "siemens", "usaf", "texture")

_WRITTEN = (
    "a board, such as '9 x 5 corners, 25 mm', or 'edge, 100 mm', 'siemens, 150 mm', 'usaf, -2:1' or "
    "'texture, 1 mm'"
)


def chart(what: str | Board, paper: str | tuple[float, float] = "A4", *, turn: float = 0.0) -> "Drawing":
    """A chart to print: a figure of the paper's size, with rulers of 100 mm to check the printer by.

    Save it as PDF or SVG, and print it at 100 %, "actual size". If the rulers measure other than 100.0 mm,
    multiply all lengths by what they measure over 100 mm.

    Parameters
    ----------
    what
        A board or its text as `Board.from_text` takes it; "edge", a dark square turned by 5°, and its width;
        "siemens", a star of 36 dark sectors, and its diameter; "usaf" and its first and last group;
        "texture" and the width of its grains. Sizes may be left out: "siemens".
    paper
        "A4", "A3", "A2", "letter", upright or not as the chart fits better, or height and width [m].
    turn
        By which the chart is turned [rad], from +x towards +y: 7° for the chessboards of data sheets.

    Raises
    ------
    FormatError
        Another chart or paper.
    GeometryError
        A chart that does not fit; the message says what does.
    LumigraphError
        Markers without OpenCV, or of a dictionary that it does not have.

    Examples
    --------
    >>> chart("9 x 5 corners, 25 mm").get_size_inches() * 25.4
    array([297., 210.])
    """
    board = what if isinstance(what, Board) else None
    name, _, rest = ("", "", "") if board else str(what).partition(",")
    sides = _sides(paper)
    angle = checks.finite("turn", turn, "rad")
    kind, size = name.strip().lower(), rest.strip()
    if kind == "texture":
        return _texture(size, sides[0])
    if kind in KINDS:
        words, dark = _target(kind, size, sides[0])
    else:
        found = board or _board(str(what))
        words, dark = found.text, _board_parts(found)
    return _fitted(words, dark, sides, angle)


def _board(text: str) -> Board:
    try:
        return Board.from_text(text)
    except FormatError as error:
        raise FormatError(f"the chart is {text!r} but must be {_WRITTEN}.") from error


def _sides(paper: str | tuple[float, float]) -> list[tuple[float, float]]:
    """Heights and widths that may be tried."""
    if not isinstance(paper, str):
        height, width = (checks.positive("paper", float(one)) for one in paper)
        return [(height, width)]
    known = {name.lower(): sides for name, sides in PAPERS.items()}
    if paper.strip().lower() in known:
        short, long = known[paper.strip().lower()]
        return [(short, long), (long, short)]
    parts = re.split(r"\s*[x×]\s*", paper.strip())
    if len(parts) != 2:
        raise FormatError(
            f"the paper is {paper!r} but must be {', '.join(PAPERS)}, or width x height such as "
            "'300 mm x 200 mm'."
        )
    width, height = (checks.positive("paper", parse(one)) for one in parts)
    return [(height, width)]


def _fitted(words: str, dark: list[np.ndarray], sides: list[tuple[float, float]], turn: float) -> "Drawing":
    """Drawing on the first paper that it fits on, or an error."""
    from lumigraph.plots.sheets import room, sheet

    turned = [one @ _turning(turn) for one in dark]
    need = 2 * np.abs(np.concatenate(turned)).max(0)
    parts = [float((np.array(room(paper)) / need).min()) for paper in sides]
    for paper, part in zip(sides, parts, strict=True):
        if part >= 1:
            return sheet(turned, paper, _told(words, turn))
    raise GeometryError(
        f"the chart ({words}) is {_size(need)} but the paper has room for "
        f"{' or '.join(_size(room(paper)) for paper in sides)}. Make it {math.floor(100 * max(parts))} % as "
        "large, or use other paper."
    )


def _turning(angle: float) -> np.ndarray:
    """Rotation (2, 2) of rows of (y, x) from +x towards +y."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def _size(space: Sequence[float] | np.ndarray) -> str:
    return f"{space[1] * 1e3:.0f} x {space[0] * 1e3:.0f} mm"


def _told(words: str, turn: float = 0.0) -> str:
    turned = f", turned by {math.degrees(turn):g}°" if turn else ""
    return (
        f"{words}{turned}. Print at 100 % (actual size). Both rulers are 100.0 mm long:\n"
        "if they measure other, multiply all lengths by what they measure / 100 mm. "
        "Glue the sheet to something flat."
    )


def _board_parts(board: Board) -> list[np.ndarray]:
    """Polygons of a board about its middle."""
    down, across = board.shape
    if board.pattern in ("dots", "asymmetric dots"):
        angle = np.arange(ROUND) * 2 * math.pi / ROUND
        outline = board.radius * np.stack([np.sin(angle), np.cos(angle)], 1)
        return [point[1:] - board.middle[1:] + outline for point in board.points()]
    s, corner = board.spacing, -board.middle[1:] - board.spacing
    squares = [(i, j) for i in range(down + 1) for j in range(across + 1)]
    found = [_rectangle(corner + s * np.array(at), (s, s)) for at in squares if sum(at) % 2 == 0]
    if board.pattern != "charuco":
        return found
    size, white = float(board.size or 0), [at for at in squares if sum(at) % 2]
    for at, dark in zip(white, markers(board), strict=False):
        origin = corner + s * np.array(at) + (s - size) / 2
        found += [
            _rectangle(origin + size * np.array(low), size * np.array(span)) for low, span in _runs(dark)
        ]
    return found


def _runs(dark: np.ndarray) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Rectangles (corner, size) over true cells (n, n), in parts of the whole: their rows and their columns.

    Both, so that no hairline of white shows between neighbours.
    """
    n, found = len(dark), []
    for cells, upright in ((dark, False), (dark.T, True)):
        for i, row in enumerate(cells):
            ends = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(int)))
            for first, last in ends.reshape(-1, 2):
                low, span = (i / n, first / n), (1 / n, (last - first) / n)
                found.append((low[::-1], span[::-1]) if upright else (low, span))
    return found


def _rectangle(corner: np.ndarray, size: np.ndarray | tuple[float, float]) -> np.ndarray:
    (y, x), (high, wide) = corner, size
    return np.array([[y, x], [y, x + wide], [y + high, x + wide], [y + high, x]])


def _target(kind: str, size: str, paper: tuple[float, float]) -> tuple[str, list[np.ndarray]]:
    """Words and polygons of an edge, a star or USAF-1951."""
    from lumigraph.plots.sheets import room

    if kind == "usaf":
        first, last = groups = _groups(size)
        return f"USAF-1951, groups {first} to {last}", _usaf(groups)
    largest = math.floor(85 * min(room(paper))) / 100  # in whole centimetres
    width = checks.positive("size", parse(size)) if size else max(largest, 0.01)
    if kind == "edge":
        return f"dark square of {width * 1e3:g} mm, turned by 5°", _edge(width)
    return f"Siemens star of {SPOKES} dark sectors, {width * 1e3:g} mm", _star(width)


def _groups(text: str) -> tuple[int, int]:
    if not text:
        return GROUPS
    ends = re.fullmatch(r"(-?\d{1,2})\s*:\s*(-?\d{1,2})", text)
    if ends is None or int(ends[1]) > int(ends[2]):
        raise FormatError(f"the groups are {text!r} but must be the first and the last, such as '-2:1'.")
    return int(ends[1]), int(ends[2])


def _usaf(groups: tuple[int, int]) -> list[np.ndarray]:
    found = []
    for _, _, (top, left), width in usaf_elements(groups):
        for k in (0, 2, 4):
            found.append(_rectangle(np.array([top, left + k * width]), (5 * width, width)))
            found.append(_rectangle(np.array([top + k * width, left + 7 * width]), (width, 5 * width)))
    return found


def _edge(size: float) -> list[np.ndarray]:
    square = _rectangle(np.array([-size / 2, -size / 2]), (size, size))
    return [square @ _turning(EDGE_TURN)]


def _star(diameter: float) -> list[np.ndarray]:
    steps = np.linspace(-0.5, 0.5, 2 * ROUND // SPOKES) * math.pi / SPOKES
    found = []
    for k in range(SPOKES):
        angle = 2 * math.pi * (k + 0.5) / SPOKES + steps  # dark between bright spokes, of which one is on +x
        rim = diameter / 2 * np.stack([np.sin(angle), np.cos(angle)], 1)
        found.append(np.concatenate([np.zeros((1, 2)), rim]))
    return found


def _texture(size: str, paper: tuple[float, float]) -> "Drawing":
    """A random grey print over all of the room."""
    from lumigraph.plots.sheets import room, sheet

    width = checks.positive("grain", parse(size)) if size else 1e-3
    space = room(paper)
    pitch = width / 3
    shape = tuple(math.ceil(side / pitch) for side in space)
    if math.prod(shape) > 1e8:
        raise GeometryError(
            f"grains of {width * 1e3:.3g} mm make {shape[1]} x {shape[0]} samples. Give larger."
        )
    scene = texture(Grid((shape[0], shape[1]), (pitch, pitch)), width)
    grains = cast("Slice", scene.parts[0]).intensity
    return sheet([], paper, _told(f"texture, grains of {width * 1e3:g} mm"), picture=grains)
