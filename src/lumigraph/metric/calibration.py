"""A camera measured by a board: `board` gives it, with its uncertainty."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from lumigraph.core.brief import brief
from lumigraph.core.result import Quantity
from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.adjustment import Adjusted, Problem, adjust, placed
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.known import disagreement
from lumigraph.metric.noise import Noise
from lumigraph.metric.spill import Spill
from lumigraph.metric.start import LEAST_CORNERS, search
from lumigraph.metric.twofold import turned_over

LEAST_FRAMES = 3
"""Pictures of the board."""

_TIED = 0.95
"""Correlation above which two numbers are reported as hardly separable."""

_BENT = 5e-4
"""Rms height of a board's corners over its diagonal from which on a note says so."""

_LENGTHS = ("f", "L", "b")

_ROUNDS = 2
"""Rounds that correct for light that lenslets spread and spill."""

WELL = 0.01
"""Half a 95 % interval over a length, beyond which a note names it."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Position and rotation of a board on a picture.

    Parameters
    ----------
    frame
        Its picture.
    turn, shift
        Rotation vector (z, y, x) [rad] and position (z, y, x) [m] of its corner 0, from the main lens.
    covariance
        (6, 6) of both, the camera's uncertainty included.
    residual_px, expected_px
        Root mean square along an axis of what its corners are off, and what noise and the camera's
        uncertainty predict for corners that did not take part in the camera's calibration.
    """

    frame: int
    turn: np.ndarray
    shift: np.ndarray
    covariance: np.ndarray
    residual_px: float
    expected_px: float

    __repr__ = brief

    def points(self, board: Board) -> np.ndarray:
        """Corners (n, 3) as (z, y, x) from the main lens [m]."""
        return geometry.moved(board.points(), np.concatenate([self.turn, self.shift]))


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A camera and how well it is known.

    Parameters
    ----------
    camera
        The camera.
    covariance
        Of `camera.numbers`.
    noise
        Of corners.
    board
        What it was measured with.
    poses
        One for each picture.
    residual_px
        Root mean square along an axis, all corners.
    left_out
        Corners that fit nothing and did not take part.
    notes
        What to know, one sentence each.
    spill
        The light beside its place that was allowed for; `triangulate` allows for it, too.
    """

    camera: MetricCamera
    covariance: np.ndarray
    noise: Noise
    board: Board
    poses: tuple[Pose, ...]
    residual_px: float
    left_out: int
    notes: tuple[str, ...]
    spill: Spill | None = None

    __repr__ = brief

    @property
    def errors(self) -> np.ndarray:
        """Standard deviations of `camera.numbers`."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation matrix of `camera.numbers`."""
        spread = np.where(self.errors > 0, self.errors, 1.0)
        return self.covariance / np.outer(spread, spread)

    @property
    def bow(self) -> float:
        """Root mean square by which the board's corners stand out of their plane [m]."""
        return float(np.sqrt(np.mean(np.square(self.board.heights or 0.0))))

    def tied(self) -> Iterator[tuple[str, str, float]]:
        """Pairs of numbers that the pictures hardly separate, with their correlation."""
        table = self.correlation
        for j, k in combinations(range(len(geometry.NAMES)), 2):
            if abs(table[j, k]) > _TIED:
                yield geometry.NAMES[j], geometry.NAMES[k], float(table[j, k])

    def quantities(self) -> tuple[Quantity, ...]:
        """Lengths with their 95 % intervals, and what was left over."""
        numbers, error = self.camera.numbers, 1.96 * self.errors

        def known(name: str, label: str, unit: str) -> Quantity:
            k = geometry.NAMES.index(name)
            return Quantity(
                label, float(numbers[k]), unit, (float(numbers[k] - error[k]), float(numbers[k] + error[k]))
            )

        return (
            known("f", "focal_length", "m"),
            known("L", "separation", "m"),
            known("b", "lenslet_distance", "m"),
            known("L/E", "separation_over_exit_pupil", "1"),
            known("axis y", "axis_y_px", "px"),
            known("axis x", "axis_x_px", "px"),
            known("tilt y", "tilt_y", "rad"),
            known("tilt x", "tilt_x", "rad"),
            *(known(name, name, "1") for name in ("k1", "k2", "k3", "p1", "p2")),
            Quantity("gains", tuple(map(float, self.camera.gains)), "1"),
            Quantity("residual_px", self.residual_px, "px"),
            Quantity("noise_px", tuple(map(float, self.noise.own)), "px"),
            Quantity("shared_noise_px", self.noise.shared, "px"),
            Quantity("board_bow", self.bow, "m"),
            Quantity("pictures", len(self.poses)),
            Quantity("left_out", self.left_out),
        )

    def locate(self, corners: Corners) -> tuple[Pose, ...]:
        """Poses of the board on pictures that did not take part.

        Raises
        ------
        CalibrationError
            Corners that the board does not have, or pictures with fewer than six of them.
        """
        _check(corners, self.board)
        corners = corners.cleared(self.camera)
        return tuple(self._located(corners[corners.frame == frame]) for frame in corners.frames)

    def _located(self, corners: Corners) -> Pose:
        start = _start(corners, self.board, self.camera)
        problem, found = placed(corners, self.board, self.camera, self.noise, start)
        covariance, expected = self._predicted(problem, found)
        residual = math.sqrt(float(np.mean(problem.misfit(found) ** 2)))
        return Pose(int(corners.frame[0]), found[-6:-3], found[-3:], covariance, residual, expected)

    def _predicted(self, problem: Problem, unknowns: np.ndarray) -> tuple[np.ndarray, float]:
        """Covariance (6, 6) of a pose by a camera that is uncertain, and the rms that is expected [px]."""
        fixed = problem.free.shape[1]
        white = problem.jacobian(unknowns)
        mine = white[:, fixed:]
        back = np.linalg.pinv(problem.free)
        camera = back @ self.covariance @ back.T
        sway = -np.linalg.pinv(mine) @ white[:, :fixed]  # of the pose with the camera
        slopes = problem.slopes(unknowns).reshape(-1, fixed + 6)
        seen = slopes[:, :fixed] + slopes[:, fixed:] @ sway
        free = 1 - min(1.0, 6 / (2 * int(problem.sight.max() + 1)))
        variance = (
            np.mean(problem.own**2)
            + self.noise.shared**2 * free
            + np.mean(np.sum((seen @ camera) * seen, axis=1))
        )
        return np.linalg.inv(mine.T @ mine) + sway @ camera @ sway.T, math.sqrt(float(variance))


def board(corners: Corners, board: Board, nominal: Nominal) -> Measured:
    """A camera from the corners of a board on several pictures.

    The camera and the board's positions are adjusted together until the corners computed are those seen,
    weighted by the corners' own noise, which is estimated, and by what is known of the camera. Whatever the
    pictures do not determine stays near its known value, with a wide interval.

    Parameters
    ----------
    corners
        As they are seen behind lenslets, two or more for most corners.
    board
        What they belong to.
    nominal
        What data sheets say of the camera.

    Raises
    ------
    CalibrationError
        Fewer than three pictures, a board that stands the same on all, corners that the board does not have,
        corners that fit no camera, or a board whose squares are, beyond doubt, not as wide as they are said
        to be.

    Notes
    -----
    Focal length and the lens' distance from the lenslets differ little in what they change: 14,346 places of
    corners behind the lenslets of a Raytrix R12 leave the focal length to within millimetres.
    `Measured.tied` names such pairs.

    Examples
    --------
    ``board(corners, Board.from_text("9 x 5 corners, 10 mm"), Nominal(50e-3, 5.5e-6, (3068, 4080)))``
    """
    _check(corners, board)
    if len(corners.frames) < LEAST_FRAMES:
        raise CalibrationError(
            f"the board is on {len(corners.frames)} pictures but must be on {LEAST_FRAMES} or more, at "
            "different distances and angles."
        )
    camera, poses = search(corners, board, nominal)
    known = np.array(sorted(poses))
    usable = np.isin(corners.frame, known)
    found = adjust(corners[usable], board, nominal, camera, np.array([poses[f] for f in known.tolist()]))
    found = turned_over(found, corners[usable], board, nominal)
    if corners.spill is not None:
        found = _cleared(found, corners[usable], corners.spill, board, nominal)
    return _measured(found, corners[usable], found.board, nominal, len(corners.frames) - len(known))


def _cleared(found: Adjusted, corners: Corners, spill: Spill, board: Board, nominal: Nominal) -> Adjusted:
    """Adjustment by corners corrected for the light that lenslets spread and spill; its error is included.

    In micro-images, what is known of near and of far boards may be wrong by different parts.
    """
    again = found
    for _ in range(_ROUNDS):  # it depends on b
        again = adjust(corners.cleared(again.camera), board, nominal, again.camera, again.poses)
    numbers = [_numbers(found), _numbers(again)]
    if not corners.in_views:
        cleared, near = corners.cleared(again.camera), np.abs(corners.moved) > abs(corners.sharp)
        half = replace(cleared, place=np.where(near[:, None], cleared.place, corners.place))
        numbers.insert(1, _numbers(adjust(half, board, nominal, again.camera, again.poses)))
    moved = spill.unsure(again.camera) * np.diff(numbers, axis=0)
    return replace(again, covariance=again.covariance + moved.T @ moved)


def _numbers(found: Adjusted) -> np.ndarray:
    """All that was adjusted."""
    return np.append(found.camera.numbers, found.poses)


def _measured(found: Adjusted, corners: Corners, board: Board, nominal: Nominal, unused: int) -> Measured:
    numbers = len(found.camera.numbers)
    result = Measured(
        found.camera, found.covariance[:numbers, :numbers], found.noise, board, (),
        math.sqrt(float(np.mean(found.residual**2))), int(np.sum(~found.kept)), (), corners.spill,
    )  # fmt: skip
    poses = []
    for k, frame in enumerate(corners.frames.tolist()):
        mine = corners.frame == frame
        rows = slice(numbers + 6 * k, numbers + 6 * k + 6)
        off = math.sqrt(float(np.mean(found.residual[mine] ** 2)))
        expected = math.sqrt(float(np.mean(found.own[mine] ** 2)) + found.noise.shared**2)
        pose = found.poses[k]
        poses.append(Pose(frame, pose[:3], pose[3:], found.covariance[rows, rows], off, expected))
    result = replace(result, poses=tuple(poses))
    told = [_spilt(corners, found.camera)] if corners.in_views or corners.spill is not None else []
    return replace(result, notes=(*_notes(result, nominal, unused), *told))


def _notes(result: Measured, nominal: Nominal, unused: int) -> Iterator[str]:
    """Remarks to read before trusting a camera."""
    yield from disagreement(result.camera, result.covariance, nominal, result.board)
    if unused:
        yield f"{unused} pictures show too few corners for a position and were not used"
    f, error = result.camera.focal_length, float(result.errors[0])
    given = nominal.focal_length * nominal.focal_length_error
    if error > 0.7 * given:
        yield (
            f"the pictures hardly determine the focal length: {f * 1e3:.2f} mm and all distances rest on the "
            f"{given * 1e3:.2g} mm to which it was known. While the exit pupil is free, other poses of the "
            "board hardly change that; a measured focal length does"
        )
    if unsure := ", ".join(_unsure(result)):
        yield (
            f"not known to {WELL:.0%}, in 95 of 100 cases: {unsure}. `lumigraph board plan` says which "
            "pictures determine more, and what none determines"
        )
    for one, other, how in result.tied():
        if one in _LENGTHS or other in _LENGTHS:
            yield f"{one} and {other} change the pictures alike (correlation {how:.3f})"
    if result.board.radius and result.board.size is None:
        yield (
            f"dots are taken as {2e3 * result.board.radius:.4g} mm wide, half of their spacing, to find "
            "their middles from their outlines' on boards that lean. Give their width if it is another"
        )
    if (bow := result.bow) > _BENT * result.board.diagonal:
        yield (
            f"the board is not flat: its corners stand {bow * 1e3:.2g} mm rms out of their plane, which is "
            "measured and allowed for"
        )
    if result.left_out:
        yield f"{result.left_out} places fit no corner and were left out"


def _spilt(corners: Corners, camera: MetricCamera) -> str:
    """Remark on the correction for light that lenslets spread and spill."""
    what = (
        "light that lenslets spill into their neighbours' micro-images moves corners in views"
        if corners.in_views
        else "where the main lens' stop cuts a lenslet's beam, diffraction moves corners outwards"
    )
    spill = corners.spill
    if spill is None:
        return (
            f"{what} and makes b too long, by 2 to 6 % behind lenslets of 62 µm at f/14: this table of "
            "corners does not say by how much. Measure raw images, or a table that was written from them"
        )
    wavelength, unsure = spill.wavelength, spill.unsure(camera)
    told = f"{what}, which is allowed for by diffraction at {wavelength * 1e9:.0f} nm, to {unsure:.0%}"
    if not corners.in_views and not spill.edges:
        return f"{told}: a white image with dark between micro-images would show the lenslets' focus"
    if corners.in_views or not (unmade := spill.unmade(camera)):
        return told
    (width, blur), (nearest, least) = unmade
    return (
        f"{told}: white micro-images are {width:.3f} pitches wide with edges {blur:.3f} soft, but such light "
        f"makes them {nearest:.3f} wide and {least:.3f} soft. Give the light's wavelength; pictures that "
        "rays drew have none (`find_corners`)"
    )


def _unsure(result: Measured) -> Iterator[str]:
    """Lengths whose 95 % intervals are wide, and by how much."""
    known = list(zip(_LENGTHS, result.camera.numbers.tolist(), result.errors.tolist(), strict=False))
    far = [(pose.shift[0], math.sqrt(pose.covariance[3, 3])) for pose in result.poses]
    worst = max(far, key=lambda one: one[1] / one[0], default=(1.0, 0.0))
    for name, length, error in (*known, ("the board's distance", *worst)):
        if 1.96 * error > WELL * abs(length):
            yield f"{name} ± {196 * error / abs(length):.2g} %"


def _check(corners: Corners, board: Board) -> None:
    most = board.shape[0] * board.shape[1]
    if int(corners.corner.max()) >= most:
        raise CalibrationError(
            f"corner {int(corners.corner.max())} is not one of the board's, 0 to {most - 1} "
            f"({board.shape[0]} x {board.shape[1]})."
        )


def _start(corners: Corners, board: Board, camera: MetricCamera) -> np.ndarray:
    """A pose (6,) of a picture by a known camera."""
    from lumigraph.metric.start import pose, virtual

    seen = virtual(corners, camera.axis)
    points = seen.points(camera.focal_length, camera.separation, camera.lenslet_distance, camera.pixel_pitch)
    usable = np.isfinite(points[:, 0])
    if usable.sum() < LEAST_CORNERS:
        raise CalibrationError(
            f"picture {int(corners.frame[0])} has {int(usable.sum())} usable corners but needs "
            f"{LEAST_CORNERS}."
        )
    return pose(board.points()[seen.corner[usable]], points[usable])
