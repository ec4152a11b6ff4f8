"""Next moves of a bench's motors: to where nothing is out of place, from the side that tells most."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.errors import LumigraphError
from lumigraph.metrology.alignment.belief import Belief
from lumigraph.metrology.alignment.rays import BenchRays
from lumigraph.metrology.alignment.setup import STATE_UNITS, STATES, Motor, shown

TOLERANCES = {"m": 5e-6, "rad": 3.49e-4, "1": 1e-3}
"""Error that may be left, by unit: 5 µm, 0.02°, 0.1 %."""

SURE = 1.96
"""Standard deviations that hold 95 %."""

_ONE_SIDED = 1.645
"""Standard deviations below which 95 % are."""

_DEADBAND = 0.2, 0.5  # of the tolerance, and of the standard deviation: smaller moves are not made
_BEYOND = 1.2  # times the backlash that a motor goes back before it comes from the other side
_LEARN = 6.0
"""Times the backlash, the tolerance and the standard deviation that moves go which tell a sign."""


class BenchError(LumigraphError):
    """Something on the bench does not do what it should."""


@dataclass(frozen=True, slots=True)
class Move:
    """Move of one motor.

    Parameters
    ----------
    number
        Of the motor.
    start, end
        Positions [m, rad or 1].
    via
        Position in between, from which the end is reached; None for a straight move.
    side
        1 if it comes to its end from below, -1 from above.
    expected
        Change of what it moves.
    """

    number: int
    start: float
    end: float
    via: float | None
    side: int
    expected: float

    @property
    def stops(self) -> tuple[float, ...]:
        """Positions to go to, one after the other."""
        return (self.end,) if self.via is None else (self.via, self.end)


def tolerance(tolerances: Mapping[str, float], state: str) -> float:
    """Tolerance of one of `STATES`: by its name, else by its unit."""
    return tolerances.get(state, tolerances.get(STATE_UNITS[STATES.index(state)], 0.0))


def undetermined(belief: Belief, rays: BenchRays, tolerances: Mapping[str, float]) -> tuple[str, ...]:
    """Names of what motors move that is not known to the tolerance, nor better after another exposure."""
    after, found = belief.expected(rays), []
    for motor in belief.motors:
        error, next_error = belief.error(motor.moves), after.error(motor.moves)
        if _ONE_SIDED * error > tolerance(tolerances, motor.moves) and next_error > 0.9 * error:
            found.append(motor.moves)
    return tuple(found)


def is_within(belief: Belief, tolerances: Mapping[str, float], but: Sequence[str] = ()) -> bool:
    """True if everything that motors move is within its tolerance, in 95 of 100 cases.

    Of those in `but` the value counts only as far as it is known.
    """
    for one in belief.motors:
        error, allowed = belief.error(one.moves), tolerance(tolerances, one.moves)
        known = max(allowed, _DEADBAND[1] * error) if one.moves in but else allowed - _ONE_SIDED * error
        if abs(belief[one.moves]) > known:
            return False
    return True


def route(motor: Motor, place: tuple[int, float, int], end: float, side: int) -> Move | None:
    """Move from a place to an end, which it comes to from a side; None where limits are in the way.

    Parameters
    ----------
    motor
        The motor.
    place
        Its number, where it stands, and the side that it came from.
    end, side
        Where it goes.
    """
    number, start, came = place
    end = motor.rounded(end)
    far = (end - start) * side
    straight = far >= (0.0 if came == side else _BEYOND * motor.backlash)
    via = None if straight else motor.rounded(end - side * _BEYOND * motor.backlash)
    if via is not None and via == end:
        via = None
    low, high = motor.limits
    if not all(low <= one <= high for one in (end, end if via is None else via)):
        return None
    return Move(number, start, end, via, side, motor.sign * (end - start))


def engaging(belief: Belief, positions: Sequence[float]) -> Iterator[Move]:
    """Moves that take up the play of motors and leave them where they are."""
    for number, (motor, start) in enumerate(zip(belief.motors, positions, strict=True)):
        if motor.backlash and not belief.sides[number]:
            found = [route(motor, (number, start, 0), start, side) for side in (1, -1)]
            yield from [one for one in found if one is not None][:1]


def learning(belief: Belief, positions: Sequence[float], tolerances: Mapping[str, float]) -> Iterator[Move]:
    """Small moves of all motors whose sign is not known; of each from the side it came from.

    Raises
    ------
    BenchError
        Limits are too near.
    """
    for number, (motor, start) in enumerate(zip(belief.motors, positions, strict=True)):
        if motor.sign:
            continue
        way = _LEARN * max(motor.backlash, tolerance(tolerances, motor.moves), belief.error(motor.moves))
        side = belief.sides[number] or 1
        found = [
            route(motor, (number, start, belief.sides[number]), start + one, side) for one in (way, -way)
        ]
        usable = [one for one in found if one is not None]
        if not usable:
            raise BenchError(
                f"{motor.name} cannot move by {motor.shown(way, signed=False)} either way to learn its sign: "
                f"it stands at {motor.shown(start)}. Give its sign in the bench file, or move it away."
            )
        yield usable[0]


def next_moves(
    belief: Belief, positions: Sequence[float], tolerances: Mapping[str, float], rays: BenchRays
) -> tuple[Move, ...]:
    """Moves to where everything is in its place, by what is known.

    A motor may come to its end from two sides. Where some motor will probably have to move once more, the
    side is taken whose exposure leaves the least uncertainty of place and backlash; otherwise the side from
    which the end is surest.

    Raises
    ------
    BenchError
        A limit is in the way.
    """
    choices = []
    for number, motor in enumerate(belief.motors):
        error, allowed = belief.error(motor.moves), tolerance(tolerances, motor.moves)
        if abs(belief[motor.moves]) > max(_DEADBAND[0] * allowed, _DEADBAND[1] * error):
            found = _options(belief, number, positions[number])
            choices.append([(one, _error_after(belief, one)) for one in found])
    allowed = [tolerance(tolerances, belief.motors[some[0][0].number].moves) for some in choices]
    again = any(min(e for _, e in some) > most for some, most in zip(choices, allowed, strict=True))
    if again:
        choices = [[(one, _told(belief, one, rays)) for one, _ in some] for some in choices]
    return tuple(
        min((round(score / most, 3), one.via is not None, k, one) for k, (one, score) in enumerate(some))[-1]
        for some, most in zip(choices, allowed, strict=True)
    )  # fmt: skip


def _options(belief: Belief, number: int, start: float) -> list[Move]:
    """Moves of a motor to where nothing is expected to be out of place, from both sides."""
    motor, ends, found = belief.motors[number], [], []
    for side in (belief.sides[number] or 1, -(belief.sides[number] or 1)):
        ends.append(_end(belief, number, start, side))
        move = route(motor, (number, start, belief.sides[number]), ends[-1], side)
        found += [] if move is None else [move]
    if not found:
        low, high = motor.limits
        raise BenchError(
            f"{motor.name} would have to go to {motor.shown(ends[0])} but its limits are {motor.shown(low)} "
            f"and {motor.shown(high)}. Move its carrier by hand by {shown(motor.moves, ends[0] - start)}, "
            "and start again."
        )
    return found


def _end(belief: Belief, number: int, start: float, side: int) -> float:
    """Position at which nothing is expected to be out of place."""
    motor = belief.motors[number]
    slack = belief.moved(number, 0.0, side)[motor.moves]
    return start - motor.sign * slack


def _after(belief: Belief, move: Move) -> Belief:
    return belief.moved(move.number, move.end - move.start, move.side)


def _error_after(belief: Belief, move: Move) -> float:
    """Standard deviation of what a motor moves, after a move."""
    return _after(belief, move).error(belief.motors[move.number].moves)


def _told(belief: Belief, move: Move, rays: BenchRays) -> float:
    """Standard deviation of place and backlash together, after a move and the exposure that follows."""
    after = _after(belief, move).expected(rays)
    return float(np.hypot(after.error(belief.motors[move.number].moves), after.backlash(move.number)[1]))
