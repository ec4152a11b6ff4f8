"""Alignment of a bench in a closed loop: expose, compare with the camera file, move."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.short_repr import brief
from lumigraph.errors import LumigraphError
from lumigraph.instruments import Instrument
from lumigraph.instruments.telecentric import white_camera
from lumigraph.metrology.alignment.belief import Belief
from lumigraph.metrology.alignment.devices import Bench
from lumigraph.metrology.alignment.log import AlignmentLog
from lumigraph.metrology.alignment.moves import (
    SURE,
    TOLERANCES,
    BenchError,
    Move,
    engaging,
    is_within,
    learning,
    next_moves,
    route,
    tolerance,
    undetermined,
)
from lumigraph.metrology.alignment.reading import WhiteReader, WhiteReading
from lumigraph.metrology.alignment.setup import STATES, shown

_DARK = 0.2  # of the first picture's light: less is lost light
_CHECKED = 8.0  # standard deviations of a move from which on what it reached is judged
_UNMOVED = 0.3  # part of a move below which a motor moves nothing
_WORSE = 2  # times in a row that a move may make things worse
_SHOWN = 1500  # micro-images in the log at most


@dataclass(frozen=True, slots=True)
class AlignmentGoal:
    """Aim of an alignment.

    Parameters
    ----------
    tolerances
        What may be left, in 95 of 100 cases, by the name of `STATES` or by unit ("m", "rad", "1").
    pitch_error
        Standard deviation of the lenslets' pitch over the pixels', as a part of it, as of `twin`.
    exposures
        Exposures at most.
    """

    tolerances: Mapping[str, float] = field(default_factory=lambda: dict(TOLERANCES))
    pitch_error: float | None = None
    exposures: int = 12

    def __post_init__(self) -> None:
        checks.whole("exposures", self.exposures)
        for name, value in self.tolerances.items():
            if name not in (*STATES, *TOLERANCES):
                raise BenchError(
                    f"there is no tolerance of {name!r}; there are those of {', '.join(STATES)}."
                )
            checks.positive(f"tolerance of {name}", value, "1")
        object.__setattr__(self, "tolerances", {**TOLERANCES, **self.tolerances})


@dataclass(frozen=True, slots=True, eq=False)
class AlignmentStep:
    """One exposure of an alignment, and what follows from it.

    Parameters
    ----------
    number, seconds
        Of the exposure, from 0, and the bench's clock.
    status
        "learning" (moves tell signs), "moving", "exposing" (once more), "aligned" or "stopped".
    belief
        What is known after it.
    reading
        Measures of its picture.
    picture
        The picture (y, x).
    positions
        Of the motors.
    moves
        To be made next.
    reached
        Changes that the moves before have made, expected and reached, by what they move.
    notes
        What to know, one sentence each.
    """

    number: int
    seconds: float
    status: str
    belief: Belief
    reading: WhiteReading
    picture: np.ndarray
    positions: tuple[float, ...]
    moves: tuple[Move, ...] = ()
    reached: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def finished(self) -> bool:
        """True if nothing follows."""
        return self.status in ("aligned", "stopped")

    def lines(self) -> tuple[str, ...]:
        """Misalignment with its 95 % interval, one line each motor."""
        return tuple(
            f"{one.moves} {one.shown(self.belief[one.moves])} ± "
            f"{one.shown(SURE * self.belief.error(one.moves), signed=False)}"
            for one in self.belief.motors
        )  # fmt: skip

    def instructions(self) -> tuple[str, ...]:
        """Moves in words."""
        motors = self.belief.motors
        return tuple(
            f"{motors[one.number].name} from {motors[one.number].shown(one.start)} "
            + (f"over {motors[one.number].shown(one.via)} " if one.via is not None else "")
            + f"to {motors[one.number].shown(one.end)}"
            for one in self.moves
        )

    def values(self) -> dict[str, Any]:
        """Numbers for the log."""
        every, belief = -(-len(self.reading.centers) // _SHOWN), self.belief
        return {
            "number": self.number, "seconds": self.seconds, "status": self.status,
            "out": dict(zip(STATES, belief.mean[: len(STATES)].tolist(), strict=True)),
            "errors": dict(zip(STATES, belief.errors.tolist(), strict=True)),
            "moved_by_motors": [one.moves for one in belief.motors],
            "signs": [one.sign for one in belief.motors],
            "backlash": [belief.backlash(k) for k in range(len(belief.motors))],
            "positions": list(self.positions), "moves": [asdict(one) for one in self.moves],
            "reached": {name: list(pair) for name, pair in self.reached.items()},
            "brightness": self.reading.brightness, "notes": list(self.notes), "lines": list(self.lines()),
            "instructions": list(self.instructions()), "belief": belief.values(),
            "shape": list(self.picture.shape), "centers": self.reading.centers[::every].round(2).tolist(),
        }  # fmt: skip


def align(
    bench: Bench,
    camera: Instrument | WhiteReader,
    *,
    goal: AlignmentGoal | None = None,
    log: str | PathLike[str] | None = None,
    dry_run: bool = False,
) -> Iterator[AlignmentStep]:
    """Align a bench with its camera file, step by step: each step is yielded before its moves are made.

    Parameters
    ----------
    bench
        Its motors and camera.
    camera
        What it is meant to be; a `WhiteReader` of it keeps what is computed, and has a dark picture.
    goal
        Tolerances and the most exposures.
    log
        Folder for the steps; an alignment that was interrupted goes on where it was.
    dry_run
        Only expose once and plan: no motor moves.

    Raises
    ------
    BenchError
        Something on the bench does not do what it should: the message says what, what to do, and where the
        bench was left.
    """
    loop = _Loop.of(bench, camera, goal or AlignmentGoal(), log)
    loop.begin(still=dry_run)
    yield from loop.run(dry_run=dry_run)


def watch(
    bench: Bench,
    camera: Instrument | WhiteReader,
    *,
    seconds: float,
    every: float = 60.0,
    goal: AlignmentGoal | None = None,
    log: str | PathLike[str] | None = None,
) -> Iterator[AlignmentStep]:
    """Align a bench, then keep it aligned for some time; see `align` and `drift_table`.

    Parameters
    ----------
    bench, camera, goal, log
        As of `align`; the exposures of the goal are those of the alignment.
    seconds
        How long.
    every
        Seconds from one exposure to the next.

    Raises
    ------
    BenchError
        As of `align`.
    """
    loop = _Loop.of(bench, camera, goal or AlignmentGoal(), log)
    loop.begin()
    yield from loop.run()
    end = bench.now() + seconds
    while bench.now() < end:
        before = bench.now()
        bench.wait(every)
        loop.belief = loop.belief.drifted(bench.setup.drift * (bench.now() - before) / 3600)
        step = loop.exposed(watching=True)
        yield step
        loop.carry_out(step)


@dataclass(slots=True)
class _Loop:
    bench: Bench
    reader: WhiteReader
    goal: AlignmentGoal
    log: AlignmentLog | None
    belief: Belief
    number: int = 0
    light: float = 0.0
    pending: tuple[Move, ...] = ()
    best: tuple[float, tuple[float, ...]] | None = None
    last: float = np.inf
    worse: int = 0

    @classmethod
    def of(
        cls,
        bench: Bench,
        camera: Instrument | WhiteReader,
        goal: AlignmentGoal,
        log: str | PathLike[str] | None,
    ) -> "_Loop":
        reader = camera if isinstance(camera, WhiteReader) else WhiteReader(white_camera(camera))
        kept = None if log is None else AlignmentLog.at(log)
        if kept is not None:
            motors = [[str(value) for value in asdict(one).values()] for one in bench.setup.motors]
            kept.open({"camera": reader.camera.to_toml(), "bench": motors})
        return cls(bench, reader, goal, kept, Belief.before(bench.setup, goal.pitch_error))

    def begin(self, *, still: bool = False) -> None:
        """Take up the motors' play, or go on where the log ends."""
        count = 0 if self.log is None else self.log.count()
        if count:
            assert self.log is not None  # it has steps
            self._resume(self.log.step(count - 1), count)
        elif not still:
            for move in tuple(engaging(self.belief, self.bench.positions())):
                self._move(move)

    def _resume(self, last: dict[str, Any], count: int) -> None:
        motors = tuple(
            replace(m, sign=s) for m, s in zip(self.bench.setup.motors, last["signs"], strict=True)
        )
        self.belief, self.number, self.light = Belief.of(motors, last["belief"]), count, last["brightness"]
        moves = {one["number"]: Move(**one) for one in last["moves"]}
        for number, (motor, logged) in enumerate(zip(motors, last["positions"], strict=True)):
            stands = self.bench.position(motor)
            if number in moves:  # again from its start, whichever part of it was made
                again = route(motor, (number, stands, 0), moves[number].end, moves[number].side)
                for stop in (again or moves[number]).stops:
                    self.bench.go(motor, stop)
                way = moves[number].end - moves[number].start
                self.belief = self.belief.moved(number, way, moves[number].side)
            elif abs(stands - logged) > 2 * max(motor.step, 1e-9):  # moved by somebody
                self.belief = self.belief.widened(motor.moves, 2 * abs(stands - logged) + motor.backlash)
        self.pending = tuple(moves.values())

    def run(self, *, dry_run: bool = False) -> Iterator[AlignmentStep]:
        """Steps until all is in place."""
        first = self.number
        while True:
            step = self.exposed(last=self.number - first + 1 >= self.goal.exposures)
            yield step
            if dry_run or step.finished:
                return
            self.carry_out(step)

    def exposed(self, *, last: bool = False, watching: bool = False) -> AlignmentStep:
        """One exposure, and what follows from it."""
        positions = tuple(self.bench.positions())
        with _Told(self, positions):
            picture = self.bench.expose()
            reading = self.reader.read(picture, self.bench.top)
            self._check_light(reading)
            guess = self._freed().seen(self.reader.rays, reading)
            reading = self.reader.matched(picture, reading, guess.mean[: len(STATES)])
            reached = self._judged(reading)
            self.belief = self.belief.seen(self.reader.rays, reading)
            self._check_progress(positions)
            status, moves, notes = self._planned(list(positions), last, watching)
        step = AlignmentStep(
            self.number,
            self.bench.now(),
            status,
            self.belief,
            reading,
            picture,
            positions,
            moves,
            reached,
            notes,
        )
        self._log(step)
        self.number += 1
        return step

    def _log(self, step: AlignmentStep) -> None:
        if self.log is not None:
            self.log.record(step.number, step.values(), step.picture)

    def carry_out(self, step: AlignmentStep) -> None:
        """Make a step's moves."""
        self.pending = step.moves
        with _Told(self, step.positions):
            for move in step.moves:
                self._move(move)

    def _move(self, move: Move) -> None:
        motor = self.belief.motors[move.number]
        for stop in move.stops:
            self.bench.go(motor, stop)
        self.belief = self.belief.moved(move.number, move.end - move.start, move.side)

    def _planned(
        self, positions: list[float], last: bool, watching: bool
    ) -> tuple[str, tuple[Move, ...], tuple[str, ...]]:
        belief, allowed, rays = self.belief, self.goal.tolerances, self.reader.rays
        if moves := tuple(learning(belief, positions, allowed)):
            return "learning", moves, ()
        if watching:
            some = {name: value * 2 for name, value in allowed.items()}  # its deadband, not its goal
            return "moving", next_moves(belief, positions, some, rays), ()
        unknown = undetermined(belief, rays, allowed)
        notes = tuple(
            f"{one} is known to ± {shown(one, SURE * belief.error(one), signed=False)}; "
            "white images tell no more"
            for one in unknown
        )
        if is_within(belief, allowed, unknown):
            return "aligned", (), notes
        if last:
            return "stopped", (), (*notes, f"not within tolerance after {self.goal.exposures} exposures")
        moves = next_moves(belief, positions, allowed, rays)
        return ("moving" if moves else "exposing"), moves, notes

    def _check_light(self, reading: WhiteReading) -> None:
        self.light = self.light or reading.brightness
        if reading.brightness < _DARK * self.light:
            raise BenchError(
                f"the light is lost: {reading.brightness:.3g} a pixel, {self.light:.3g} at first. "
                "Check lamp and shutter."
            )

    def _freed(self) -> Belief:
        """Belief if motors may have done anything in the last moves."""
        free = self.belief
        for move in self.pending:
            free = free.widened(free.motors[move.number].moves, 2 * abs(move.end - move.start))
        return free

    def _judged(self, reading: WhiteReading) -> dict[str, tuple[float, float]]:
        """Changes expected and reached by the last moves; refuses motors that do not obey."""
        if not self.pending:
            return {}
        free, motors = self._freed().seen(self.reader.rays, reading), self.belief.motors
        reached, signs = {}, {}
        for move in self.pending:
            motor, way = motors[move.number], move.end - move.start
            before = self.belief[motor.moves] - motor.sign * way
            change = free[motor.moves] - before
            doubt = free.error(motor.moves) + self.belief.error(motor.moves) + motor.backlash / _CHECKED
            if abs(way) > _CHECKED * doubt or not motor.sign:
                _check_obeys(motor.name, motor.shown(way), (way, change), motor.sign)
            if not motor.sign:
                signs[move.number] = int(np.sign(change * way))
            reached[motor.moves] = (motor.sign * way, change)
        if signs:
            known = (replace(one, sign=signs.get(k, one.sign)) for k, one in enumerate(motors))
            self.belief = replace(free, motors=tuple(known))
        self.pending = ()
        return reached

    def _check_progress(self, positions: tuple[float, ...]) -> None:
        """Keep the best place, and refuse to go on where moves have made things worse twice."""
        score = max(
            abs(self.belief[one.moves]) / tolerance(self.goal.tolerances, one.moves)
            for one in self.belief.motors
        )
        self.worse = self.worse + 1 if score > max(1.5 * self.last, 1.0) else 0
        self.last = score
        if self.best is None or score <= self.best[0]:
            self.best = (score, positions)
        if self.worse >= _WORSE:
            raise BenchError(
                "moves made things worse twice. Check that motors move what the bench file says."
            )

    def back(self, positions: tuple[float, ...]) -> str:
        """Return to the best place so far, where motors still obey; says where the bench was left."""
        if self.best is None or self.best[1] == positions:
            return "the bench stands where it was"
        try:
            for number, motor in enumerate(self.belief.motors):
                move = route(motor, (number, self.bench.position(motor), 0), self.best[1][number], 1)
                for stop in move.stops if move else ():
                    self.bench.go(motor, stop)
        except LumigraphError as error:
            return f"it could not go back to its best place: {error}"
        return "the bench was brought back to its best place so far"


@dataclass(slots=True)
class _Told:
    """Context that brings the bench to safety after an error, and says where it is."""

    loop: _Loop
    positions: tuple[float, ...]

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, LumigraphError):
            left = self.loop.back(self.positions)
            if self.loop.log is not None:
                names = [one.name for one in self.loop.belief.motors]
                self.loop.log.stopped(str(error), left, dict(zip(names, self.positions, strict=True)))
            raise BenchError(f"{error} ({left}.)") from error


def _check_obeys(name: str, asked: str, ways: tuple[float, float], sign: int) -> None:
    way, change = ways
    if abs(change) < _UNMOVED * abs(way):
        raise BenchError(
            f"{name} was moved by {asked} but the picture shows {change / way:+.0%} of that: the stage "
            "does not move, or moves something else. Check its clamp and its device in the bench file."
        )
    if sign and change * sign * way < 0:
        raise BenchError(
            f"{name} is inverted: it was moved by {asked} and the picture shows the opposite. "
            f"Set sign = {-sign} in the bench file."
        )
