"""Bundle adjustment: camera and poses that explain all corners best, and how well each is known."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from lumigraph.core import memory
from lumigraph.core.checks import Pair
from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.noise import LEAST_NOISE, Noise

_ROUNDS = 3
"""Adjustments, each with the noise of the one before."""

_STEPS, _STEADY = 40, 3e-3
"""Rounds of the noise, at most, and its relative change in the last one."""

_WILD = 6.0
"""Standard deviations beyond which a place is another corner's."""


_SAME_TURN, _SAME_DISTANCE = 0.05, 0.02
"""Boards that turn by less [rad], and stand no farther apart, of their distance, count as the same."""

_FLAT = 1e-3
"""Flatness that is assumed of a board at first, over its diagonal: paper on a plate."""


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """A camera and poses, with their covariance.

    Parameters
    ----------
    camera
        With everything adjusted.
    poses
        (frames, 6) As `geometry.moved` takes them.
    covariance
        Of `camera.numbers`, then of the poses, row by row.
    noise
        Of the corners.
    residual
        (n, 2) Computed minus measured [px], of all corners that were given.
    kept
        (n,) Whether they took part.
    board
        With the heights of its corners.
    own
        (n,) Noise of each place [px].
    """

    camera: MetricCamera
    poses: np.ndarray
    covariance: np.ndarray
    noise: Noise
    residual: np.ndarray
    kept: np.ndarray
    board: Board
    own: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Residuals and their derivatives by scaled unknowns.

    Parameters
    ----------
    corners, board
        What was seen, of what.
    frame
        (n,) Index of each corner's picture among the poses.
    camera
        Gives the pixel pitch, and scales.
    priors
        (index, value, standard deviation) of the camera's numbers.
    noise
        Of the corners.
    sight
        (n,) Which places are of one corner on one picture.
    own
        (n,) Noise of each place, as `Noise.each` gives it [px].
    bow
        Standard deviation of the heights of the board's corners, which are looked for [m]; 0 for a board
        that is known.
    apart
        Pitch of the micro-images over the lenslets', and its standard deviation, if it is known.
    """

    corners: Corners
    board: Board
    frame: np.ndarray
    camera: MetricCamera
    priors: list[tuple[int, float, float]]
    noise: Noise
    sight: np.ndarray
    own: np.ndarray
    bow: float = 0.0
    apart: Pair | None = None

    @property
    def frames(self) -> int:
        """Number of poses."""
        return int(self.frame.max()) + 1

    @property
    def free(self) -> np.ndarray:
        """Matrix from unknowns to the camera's numbers; see `freedom`."""
        return freedom(self.camera)

    @property
    def heights(self) -> int:
        """Unknowns that are heights of the board's corners."""
        return self.board.shape[0] * self.board.shape[1] if self.bow else 0

    def split(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers of the camera, heights of the corners (none if they are known), and poses (frames, 6)."""
        free = self.free
        numbers = self.camera.numbers + free @ unknowns[: free.shape[1]]
        heights, poses = np.split(unknowns[free.shape[1] :], [self.heights])
        return numbers, heights, poses.reshape(self.frames, 6)

    def misfit(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, 2) Computed minus measured [px]: places, or centres of corners in views."""
        return self._misfit(self.split(unknowns)[0], self._points(unknowns))

    def _points(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, 3) What is seen, before the camera."""
        numbers, _, poses = self.split(unknowns)
        flat, in_views = self._flat(unknowns), self.corners.in_views
        if radius := self.board.radius:
            return geometry.dots(numbers, flat, poses[self.frame], radius, in_views=in_views)
        return geometry.moved(flat, poses[self.frame])

    def _misfit(self, numbers: np.ndarray, points: np.ndarray) -> np.ndarray:
        pitch, seen = self.camera.pixel_pitch, self.corners
        if seen.in_views:
            return (
                geometry.centers(numbers, points, (seen.place, seen.center), seen.kind, pitch) - seen.center
            )
        return geometry.project(numbers, points, seen.center, seen.kind, pitch) - seen.place

    def _flat(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, 3) Corners of the board in its own frame."""
        flat, (_, heights, _) = self.board.points()[self.corners.corner], self.split(unknowns)
        if not self.heights:
            return flat
        return np.column_stack([heights[self.corners.corner], flat[:, 1:]])

    def magnification(self, unknowns: np.ndarray) -> np.ndarray | None:
        """(n,) Of the lenslets for what they show; None in views."""
        if self.corners.in_views:
            return None
        numbers, _, poses = self.split(unknowns)
        points = geometry.moved(self._flat(unknowns), poses[self.frame])
        return geometry.magnification(numbers, points[:, 0])

    def slopes(self, unknowns: np.ndarray) -> np.ndarray:
        """(n, 2, unknowns) Derivatives of `misfit`."""
        free, still = self.free, None if self.board.radius else self._points(unknowns)
        camera, fixed = free.shape[1], unknowns[free.shape[1] :]

        def of_camera(mine: np.ndarray) -> np.ndarray:
            if still is None:  # where outlines of dots have their middles depends on it
                return self.misfit(np.concatenate([mine, fixed]))
            return self._misfit(self.camera.numbers + free @ mine, still)

        result = np.zeros((len(self.corners), 2, len(unknowns)))
        for k in range(camera):
            result[..., k] = geometry.slope(of_camera, unknowns[:camera], np.s_[k])
        rows, poses = np.arange(len(self.corners)), camera + self.heights
        if self.heights:  # all at once: each place depends on one
            column = camera + self.corners.corner
            result[rows, :, column] = geometry.slope(self.misfit, unknowns, np.s_[camera:poses])
        for k in range(6):  # so do poses
            column = poses + 6 * self.frame + k
            result[rows, :, column] = geometry.slope(self.misfit, unknowns, np.s_[poses + k :: 6])
        return result

    def residual(self, unknowns: np.ndarray) -> np.ndarray:
        """Residual of the corners, in standard deviations, and of prior knowledge of the camera."""
        numbers, heights, _ = self.split(unknowns)
        known = [(numbers[k] - value) / error for k, value, error in self.priors]
        even = heights / self.bow if self.bow else heights
        apart = [] if self.apart is None else (geometry.pitch_ratio(numbers) - self.apart[0]) / self.apart[1]
        return np.concatenate([self._white(self.misfit(unknowns)).ravel(), known, apart, even])

    def jacobian(self, unknowns: np.ndarray, slopes: np.ndarray | None = None) -> np.ndarray:
        """Derivatives of `residual`, by `slopes` if they are known."""
        slopes = self._white(self.slopes(unknowns) if slopes is None else slopes)
        slopes = slopes.reshape(-1, len(unknowns))
        known = np.zeros((len(self.priors), len(unknowns)))
        for row, (k, _, error) in zip(known, self.priors, strict=True):
            row[: self.free.shape[1]] = self.free[k] / error
        even = np.eye(self.heights, len(unknowns), self.free.shape[1]) / (self.bow or 1.0)
        apart = np.zeros((int(self.apart is not None), len(unknowns)))
        if self.apart is not None:
            of_camera = geometry.slopes_of_pitch_ratio(self.split(unknowns)[0]) @ self.free
            apart[0, : self.free.shape[1]] = of_camera / self.apart[1]
        return np.concatenate([slopes, known, apart, even])

    def _white(self, values: np.ndarray) -> np.ndarray:
        return self.noise.whitened(values, self.sight, self.own, self.corners.way)


def freedom(camera: MetricCamera) -> np.ndarray:
    """Numbers of the camera (all) by unknowns, scaled: the gains keep their mean."""
    kinds, plain = len(camera.gains), len(geometry.NAMES)
    f, _, b, *_ = camera.numbers
    scale = [0.1 * f, 0.1 * f, 0.1 * b, 0.1, 100, 100, 1e-2, 1e-2, 0.1, 1, 10, 1e-2, 1e-2]
    free = np.zeros((plain + kinds, plain + kinds - 1))
    free[:plain, :plain] = np.diag(scale)
    free[plain:-1, plain:], free[-1, plain:] = 0.1 * np.eye(kinds - 1), -0.1
    return free


def adjust(
    corners: Corners, board: Board, nominal: Nominal, camera: MetricCamera, poses: np.ndarray
) -> Adjusted:
    """Camera and poses from first ones.

    Parameters
    ----------
    corners, board
        What was seen, of what.
    nominal
        What is known of the camera.
    camera, poses
        To start from; poses (frames, 6) in the order of ``corners.frames``.

    Raises
    ------
    CalibrationError
        More corners than there is memory for, an adjustment that does not settle, or a board that stands the
        same on all pictures.
    """
    frame = np.searchsorted(corners.frames, corners.frame)
    kinds = len(camera.gains)
    even = Noise(np.ones(kinds), 0.0)
    priors, one = nominal.priors(kinds), np.ones(len(corners))
    first = Problem(corners, board, frame, camera, priors, even, corners.sights(), one, apart=nominal.apart)
    unknowns = np.concatenate([np.zeros(first.free.shape[1]), poses.ravel()])
    needed = 6.0 * 8 * 2 * len(corners) * len(unknowns)
    remedy = "Use fewer pictures, or every second corner."
    memory.require(needed, "the adjustment", remedy, CalibrationError)
    kept = np.ones(len(corners), bool)
    problem, found = _settled(first, unknowns, "soft_l1")  # until wild corners are known
    for _ in range(_ROUNDS):
        problem, unknowns = _bent(problem, found)
        problem, kept = _again(replace(first, bow=problem.bow), unknowns)
        problem, found = _settled(problem, unknowns)
    numbers, heights, poses = problem.split(found)
    _check_poses(poses)  # whose camera may be none
    whole = replace(first, bow=problem.bow)
    misfit, own = whole.misfit(found), problem.noise.each(corners.kind, whole.magnification(found))
    covariance = _covariance(problem, found)
    known = replace(board, heights=tuple(heights.tolist())) if len(heights) else board
    return Adjusted(camera.with_numbers(numbers), poses, covariance, problem.noise, misfit, kept, known, own)


def _check_poses(poses: np.ndarray) -> None:
    """Refuse boards (frames, 6) that stood alike on all pictures: lengths would follow from noise alone."""
    turn = float(np.linalg.norm(np.ptp(poses[:, :3], axis=0)))
    away = float(np.ptp(poses[:, 3]) / abs(np.median(poses[:, 3])))
    if turn < _SAME_TURN and away < _SAME_DISTANCE:
        raise CalibrationError(
            f"the board stands the same on all {len(poses)} pictures, to {math.degrees(turn):.2g}° and "
            f"{away:.2%} of its distance, which does not determine the camera. Take it at different "
            "distances and angles, 10° and 10 % apart or more."
        )


def _settled(problem: Problem, unknowns: np.ndarray, loss: str = "linear") -> tuple[Problem, np.ndarray]:
    """A problem and the unknowns that solve it."""
    jacobian: Any = problem.jacobian  # SciPy's types know names of methods only
    found = least_squares(problem.residual, unknowns, jacobian, x_scale="jac", loss=loss, max_nfev=200)
    if found.status <= 0:
        raise CalibrationError(
            f"the camera did not settle in {found.nfev} steps. Check the board and the nominal lengths."
        )
    return problem, found.x


def _bent(problem: Problem, unknowns: np.ndarray) -> tuple[Problem, np.ndarray]:
    """The problem of a board whose corners may stand out of its plane, as far as they were found to.

    The spread of the heights is their mean square and variance together (expectation-maximisation).
    """
    camera = problem.free.shape[1]
    if problem.heights:
        jacobian = problem.jacobian(unknowns)
        mine = slice(camera, camera + problem.heights)
        variance = np.diag(np.linalg.inv(jacobian.T @ jacobian))[mine]
        return replace(problem, bow=float(np.sqrt(np.mean(unknowns[mine] ** 2 + variance)))), unknowns
    if problem.board.heights is not None:
        return problem, unknowns
    flat = np.zeros(len(problem.board.points()))
    return replace(problem, bow=_FLAT * problem.board.diagonal), np.insert(unknowns, camera, flat)


def placed(
    corners: Corners, board: Board, camera: MetricCamera, noise: Noise, start: np.ndarray
) -> tuple[Problem, np.ndarray]:
    """One picture's problem before a camera that is known, and its unknowns with the best pose (6,) last.

    Parameters
    ----------
    corners, board
        What was seen on the picture, of what.
    camera, noise
        As they are known.
    start
        A first pose (6,).
    """
    frame = np.zeros(len(corners), int)
    problem = Problem(corners, board, frame, camera, [], noise, corners.sights(), noise.each(corners.kind))
    fixed = np.zeros(problem.free.shape[1])
    blur = problem.magnification(np.concatenate([fixed, start]))
    problem = replace(problem, own=noise.each(corners.kind, blur))

    def unknowns(pose: np.ndarray) -> np.ndarray:
        return np.concatenate([fixed, pose])

    def slopes(pose: np.ndarray) -> np.ndarray:
        return problem.jacobian(unknowns(pose))[:, len(fixed) :]

    jacobian: Any = slopes  # SciPy's types know names of methods only
    found = least_squares(lambda p: problem.residual(unknowns(p)), start, jacobian, x_scale="jac")
    return problem, unknowns(found.x)


def _again(first: Problem, unknowns: np.ndarray) -> tuple[Problem, np.ndarray]:
    """The problem with the noise of its residuals, without its outliers."""
    kind, misfit, blur = first.corners.kind, first.misfit(unknowns), first.magnification(unknowns)
    typical = np.array([
        np.median(np.abs(misfit[kind == k])) if np.any(kind == k) else 1.0 for k in range(int(kind.max()) + 1)
    ])  # fmt: skip
    kept = np.abs(misfit).max(axis=1) < _WILD * np.maximum(1.48 * typical, LEAST_NOISE)[kind]
    corners, frame = first.corners[kept], first.frame[kept]
    if len(np.unique(frame)) != first.frames:
        raise CalibrationError(
            "the corners of a picture fit no position of the board. Leave it out, or number them again."
        )
    sight = corners.sights()
    chosen = replace(first, corners=corners, frame=frame, sight=sight, own=first.own[kept])
    return _noisy(chosen, unknowns, None if blur is None else blur[kept]), kept


def _noisy(problem: Problem, unknowns: np.ndarray, blur: np.ndarray | None) -> Problem:
    """The problem with the noise that explains its residuals and the part that the unknowns absorb.

    A camera and poses that are adjusted follow the noise, the more so the fewer the corners: what is left
    over is less than the noise, by the covariance of computed places (expectation-maximisation).
    """
    corners, sight, misfit, slopes = problem.corners, problem.sight, problem.misfit(unknowns), None
    columns = misfit[..., None]
    for _ in range(_STEPS):
        noise = Noise.of(columns, sight, corners.kind, corners.way, blur)
        before, problem = problem, replace(problem, noise=noise, own=noise.each(corners.kind, blur))
        if slopes is not None and problem.noise.is_like(before.noise, _STEADY):
            break
        slopes = problem.slopes(unknowns) if slopes is None else slopes
        jacobian = problem.jacobian(unknowns, slopes)
        step, root = _solved(jacobian, problem.residual(unknowns))
        hidden = solve_triangular(root, slopes.reshape(-1, len(unknowns)).T, trans=1).T
        left = misfit - slopes @ step
        columns = np.concatenate([left[..., None], hidden.reshape(slopes.shape)], -1)
    return problem


def _solved(jacobian: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns that explain a residual best, and R (n, n): their covariance is the inverse of R' R."""
    scale = np.linalg.norm(jacobian, axis=0)
    if not scale.all():
        raise CalibrationError(
            "one of the camera's numbers has no effect on these corners. Use more pictures."
        )
    both: Any = np.linalg.qr(np.column_stack([jacobian / scale, residual]), mode="r")
    root = both[:-1, :-1]
    return solve_triangular(root, both[:-1, -1]) / scale, root * scale


def _covariance(problem: Problem, unknowns: np.ndarray) -> np.ndarray:
    """Covariance of the camera's numbers and of the poses."""
    camera, poses = problem.free.shape[1], problem.free.shape[1] + problem.heights
    _, root = _solved(problem.jacobian(unknowns), problem.residual(unknowns))
    out = np.zeros((len(problem.camera.numbers) + len(unknowns) - poses, len(unknowns)))
    out[: len(problem.camera.numbers), :camera] = problem.free
    out[len(problem.camera.numbers) :, poses:] = np.eye(len(unknowns) - poses)
    half = solve_triangular(root, out.T, trans=1)
    return half.T @ half
