"""How to take pictures of a board: poses that tell the camera's lengths best, and how well."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.core.calibration import Calibration
from lumigraph.core.result import Quantity
from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.adjustment import Problem, freedom
from lumigraph.metric.calibration import LEAST_FRAMES
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.finding import LEAST_SEEN, lit_radius
from lumigraph.metric.noise import Noise
from lumigraph.metric.views import DIRECTIONS, reach
from lumigraph.metric.windows import LEAST_SQUARE, nearest

Turn = tuple[float, float, float]

_TILTS = (0.0, 0.35, -0.35, 0.7, -0.7)  # rad: beyond, the squares are too narrow
_STEEPEST = 0.8  # rad, about both axes together
_ROLLED = 0.2
"""Turn about the line of sight in views [rad]: edges along rows may be anywhere between two lenslets."""

_RATIOS = (0.08, 0.6)  # how far a corner moves against a lenslet, as `depth.correlation` looks for it
_DISTANCES, _DISTANCES_IN_VIEWS = 12, 6
_FARTHEST = 200.0  # focal lengths

_MOVED = 3.0
"""Lenslets by which views may move a corner over the stop: so much blurs a seventh of it by half a sample."""

_MARGIN = 4.0
"""Lenslets around a corner that its saddle is looked for in."""

_BESIDE = 1.5
"""Squares beyond the outer corners that finding a board needs."""

_SURE = (0.1, 0.3)
"""Of L and b: how well they are known without any picture, over themselves."""


@dataclass(frozen=True, slots=True)
class Step:
    """One picture to take.

    Parameters
    ----------
    distance
        Of the board's middle, on the axis, from the main lens [m].
    turn
        Rotation vector (z, y, x) [rad], as that of `Pose`: z turns the board about the line of sight, y
        about its vertical, x about its horizontal middle line.
    places
        Of corners behind lenslets that it gives.
    errors
        Standard deviations (f, L, b) [m] with this picture and those before it.
    """

    distance: float
    turn: Turn
    places: int
    errors: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Pictures of a board, the most telling first.

    Parameters
    ----------
    camera, board
        Of what, by what.
    steps
        The pictures.
    """

    camera: MetricCamera
    board: Board
    steps: tuple[Step, ...]

    __repr__ = brief

    def quantities(self) -> tuple[Quantity, ...]:
        """f, L and b with the 95 % intervals that all pictures together will give, and the pictures."""
        names, numbers = ("focal_length", "separation", "lenslet_distance"), self.camera.numbers.tolist()
        spread = [1.96 * error for error in self.steps[-1].errors]
        lengths = zip(names, numbers, spread, strict=False)
        return (
            *(Quantity(name, value, "m", (value - off, value + off)) for name, value, off in lengths),
            Quantity("distances", tuple(step.distance for step in self.steps), "m"),
            Quantity("turns", tuple(step.turn for step in self.steps), "rad"),
        )

    def enough(self, part: float) -> tuple[int | None, int | None, int | None]:
        """Pictures that tell f, L and b to a part of themselves, in 95 of 100 cases; None where all do not.

        Parameters
        ----------
        part
            Half the interval's width over the length.
        """
        errors, lengths = np.array([step.errors for step in self.steps]), self.camera.numbers[:3]
        told = 1.96 * errors <= part * np.abs(lengths)
        f, L, b = (int(np.argmax(one)) + 1 if one.any() else None for one in told.T)
        return f, L, b

    def table(self) -> list[list[str]]:
        """The pictures as rows of text, their header first."""
        turns = ["turn (sight)", "tilt (vertical)", "tilt (horizontal)"]
        rows = [["picture", "distance", *turns, "places", "f", "L", "b"]]
        for number, step in enumerate(self.steps, 1):
            tilts = [f"{math.degrees(angle):+.0f}°" for angle in step.turn]
            errors = [f"± {1.96 * error * 1e3:.3g} mm" for error in step.errors]
            rows.append([str(number), f"{step.distance * 1e3:.4g} mm", *tilts, str(step.places), *errors])
        return rows


def plan(
    camera: MetricCamera,
    calibration: Calibration,
    board: Board,
    nominal: Nominal,
    *,
    pictures: int = 8,
    in_views: bool = False,
    noise_px: tuple[float, float] | None = None,
) -> Plan:
    """Poses of a board, one after the other those that tell f, L and b best together.

    Boards stand on the axis where three lenslets or more show each corner, straight or tilted; before a
    camera 1.0, where views over the stop move no corner by more than three lenslets, turned by 11° about the
    line of sight where they fit so. What a picture tells of
    the camera is known before it is taken: its Fisher information, less what its own pose takes. Each picture
    is the one that makes the sum of the relative variances of f, L and b least.

    Parameters
    ----------
    camera
        As its data sheet says, such as ``MetricCamera.of(camera_file)``.
    calibration
        Where its micro-images stand, and how much of each is lit (`fill`; all of it where that is None).
    board
        To be used.
    nominal
        How well the data sheet is known. L is taken as known to 10 %, b to 30 %.
    pictures
        How many; 3 at least.
    in_views
        Whether it is a camera 1.0, whose views show the corners.
    noise_px
        Of one place, and of what all places of a corner share (see `Noise`) [px]; None for 0.1 and 0.05, in
        views for 2 % and 1 % of a pitch.

    Raises
    ------
    CalibrationError
        Fewer than three pictures, or no distance at which the board can be used.
    """
    checks.whole("pictures", pictures, LEAST_FRAMES, CalibrationError)
    pitch = calibration.lattice.pitch
    usual = (0.02 * pitch, 0.01 * pitch) if in_views else (0.1, 0.05)
    own, shared = (checks.positive("noise_px", one, "px") for one in noise_px or usual)
    before = _Before(camera, calibration, board, Noise(np.full(len(camera.gains), own), shared), in_views)
    distances = _in_views(camera, pitch) if in_views else _distances(camera)
    useful = before.shots(distances, _ROLLED) if in_views else []
    useful = useful or before.shots(distances, 0.0)
    if not useful:
        seen = "in squares 6 samples of a view wide" if in_views else (
            f"and {LEAST_SEEN} lenslets show each corner, in squares {LEAST_SQUARE:.2g} px wide"
        )  # fmt: skip
        raise CalibrationError(
            f"there is no place where the whole {board.what}, {board.spacing * 1e3:.3g} mm, is in the "
            f"picture {seen} or wider. Try squares of another size."
        )
    return Plan(camera, board, tuple(_chosen(useful, camera, nominal, pictures)))


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """A picture and its information of the camera's unknowns, whatever its pose."""

    distance: float
    turn: Turn
    places: int
    told: np.ndarray


def _distances(camera: MetricCamera) -> list[float]:
    """At which micro-images can be compared, from near to far, evenly in the image."""
    f, low = camera.focal_length, 1.02 * camera.focal_length
    every = 1 / np.linspace(1 / low, 1 / (_FARTHEST * f), 400)
    image = f * every / (every - f)
    ratio = np.abs(camera.lenslet_distance / (camera.separation - image))
    usable = every[(ratio >= _RATIOS[0]) & (ratio <= _RATIOS[1])]
    if not len(usable):
        raise CalibrationError(
            f"nothing in front of the camera is shown {_RATIOS[0]:g} to {_RATIOS[1]:g} times as large as its "
            f"image by a lenslet: L is {camera.separation * 1e3:.4g} mm, b "
            f"{camera.lenslet_distance * 1e3:.4g} mm."
        )
    return usable[np.linspace(0, len(usable) - 1, min(_DISTANCES, len(usable))).astype(int)].tolist()


def _in_views(camera: MetricCamera, pitch: float) -> list[float]:
    """At which views are sharp and can be compared, from near to far, evenly in the image."""
    f = camera.focal_length
    every = 1 / np.linspace(1 / (1.02 * f), 1 / (_FARTHEST * f), 400)
    points = np.stack([every, 0 * every, 0 * every], 1)
    moved = [_centers(camera, points, np.array([0.0, side * pitch / 2])) for side in (1, -1)]
    usable = every[np.abs(moved[0] - moved[1]).max(1) <= _MOVED * pitch]
    return usable[np.linspace(0, len(usable) - 1, min(_DISTANCES_IN_VIEWS, len(usable))).astype(int)].tolist()


def _centers(camera: MetricCamera, points: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Centres (n, 2) of the micro-images that show points (n, 3) at ways from them, (2,) or (n, 2) [px]."""
    ways = np.broadcast_to(way, (len(points), 2))
    kind = np.zeros(len(points), int)
    return geometry.centers(camera.numbers, points, (ways, np.zeros_like(ways)), kind, camera.pixel_pitch)


@dataclass(frozen=True, slots=True, eq=False)
class _Before:
    """A camera before a board, and the noise of its corners."""

    camera: MetricCamera
    calibration: Calibration
    board: Board
    noise: Noise
    in_views: bool

    def shots(self, distances: list[float], roll: float) -> list[_Shot]:
        """Of boards straight and tilted, turned about the line of sight, where all corners can be used."""
        turns = [(roll, y, x) for y, x in product(_TILTS, _TILTS) if math.hypot(y, x) <= _STEEPEST]
        every = (self.shot(*place) for place in product(distances, turns))
        return [shot for shot in every if shot is not None]

    def shot(self, distance: float, turn: Turn) -> _Shot | None:
        """A board at a distance; None where not all of its corners can be used."""
        still = np.array([*turn, 0.0, 0.0, 0.0])
        middle = geometry.moved(self.board.middle, still)
        pose = np.concatenate([turn, np.array([distance, 0.0, 0.0]) - middle])
        points = geometry.moved(self.board.points(), pose)
        if points[:, 0].min() <= 1.02 * self.camera.focal_length or not self.whole(pose):
            return None
        seen = self.by_views(points) if self.in_views else self.by_lenslets(points)
        if seen is None:
            return None
        frame, sights = np.zeros(len(seen), int), seen.sights()
        own_noise = self.noise.each(seen.kind)
        problem = Problem(seen, self.board, frame, self.camera, [], self.noise, sights, own_noise)
        own = problem.free.shape[1]
        slopes = problem.jacobian(np.concatenate([np.zeros(own), pose]))
        of_camera, of_pose = slopes[:, :own], slopes[:, own:]
        across = of_pose.T @ of_camera
        told = of_camera.T @ of_camera - across.T @ np.linalg.solve(of_pose.T @ of_pose, across)
        return _Shot(distance, turn, len(seen), told)

    def whole(self, pose: np.ndarray) -> bool:
        """Whether the board is in the picture with its outer squares and half a square of white margin."""
        rim = [np.array([-_BESIDE, n - 1 + _BESIDE]) * self.board.spacing for n in self.board.shape]
        y, x = (one.ravel() for one in np.meshgrid(*rim))
        at = _centers(self.camera, geometry.moved(np.stack([0 * y, y, x], 1), pose), np.zeros(2))
        return bool(((at > 0) & (at < np.array(self.calibration.shape) - 1)).all())

    def by_lenslets(self, points: np.ndarray) -> Corners | None:
        """Places of all corners behind lenslets; None where one cannot be found."""
        camera, calibration = self.camera, self.calibration
        rows, columns = calibration.shape
        index = calibration.indices_within((0, rows - 1), (0, columns - 1))
        center, kinds = calibration.position(index), calibration.lattice.kind(*index.T)
        corner, lenslet = (each.ravel() for each in np.indices((len(points), len(center))))
        place = camera.project(points[corner], center[lenslet], kinds[lenslet])
        shown = np.hypot(*(place - center[lenslet]).T) <= lit_radius(calibration)
        if np.bincount(corner[shown], minlength=len(points)).min() < LEAST_SEEN:
            return None
        if _square(camera, points) < LEAST_SQUARE:
            return None
        corner, lenslet, place = corner[shown], lenslet[shown], place[shown]
        return Corners(np.zeros(len(corner), int), corner, place, center[lenslet], kinds[lenslet])

    def by_views(self, points: np.ndarray) -> Corners | None:
        """Centres of micro-images showing the corners in each view; None where one is not in the picture."""
        pitch, size = self.calibration.lattice.pitch, np.array(self.calibration.shape)
        at = (np.arange(DIRECTIONS) - DIRECTIONS // 2) * pitch / DIRECTIONS
        ways = np.stack(np.meshgrid(at, at, indexing="ij"), -1).reshape(-1, 2)
        ways = ways[np.hypot(*ways.T) <= reach(self.calibration, DIRECTIONS)]
        corner, view = (each.ravel() for each in np.indices((len(points), len(ways))))
        center = _centers(self.camera, points[corner], ways[view])
        middle = center.reshape(len(points), len(ways), 2).mean(1)
        wide, margin = nearest(middle) / pitch, _MARGIN * pitch
        if wide < LEAST_SQUARE or not ((center > margin) & (center < size - 1 - margin)).all():
            return None
        frame = np.zeros(len(corner), int)
        return Corners(frame, corner, center + ways[view], center, frame, in_views=True)


def _square(camera: MetricCamera, points: np.ndarray) -> float:
    """Least way between corners behind a lenslet [px]."""
    return nearest(camera.project(points, np.repeat(np.array([camera.axis]), len(points), 0)))


def _chosen(shots: list[_Shot], camera: MetricCamera, nominal: Nominal, pictures: int) -> Iterator[Step]:
    free, lengths = freedom(camera), camera.numbers[:3]
    beforehand = [(k, error) for k, _, error in nominal.priors(len(camera.gains))]
    beforehand += [(k + 1, share * lengths[k + 1]) for k, share in enumerate(_SURE)]
    known = [free[k] / error for k, error in beforehand]
    if nominal.apart is not None:
        known.append(geometry.slopes_of_pitch_ratio(camera.numbers) @ free / nominal.apart[1])
    known = np.array(known)
    told = known.T @ known

    def errors(told: np.ndarray) -> np.ndarray:
        return np.sqrt(np.diag(free @ np.linalg.inv(told) @ free.T)[:3])

    for _ in range(pictures):
        shot = min(shots, key=lambda shot: float(np.sum((errors(told + shot.told) / lengths) ** 2)))
        told = told + shot.told
        f, L, b = errors(told).tolist()
        yield Step(shot.distance, shot.turn, shot.places, (f, L, b))
