"""Memory that the periodic operator's matrices take while they are built, and what is built together."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from lumigraph.elements import LensletArray
from lumigraph.operators import cells as _cells
from lumigraph.operators.cell_response import INFINITE
from lumigraph.operators.optics import Optics
from lumigraph.operators.places import INSIDE, Place, State, alike, places, terms


def build_bytes(optics: Optics, workers: int = 1) -> float:
    """Memory that building all parts takes [bytes], from their sizes and the usual number of factors."""
    cells, near = optics.cells, optics.near
    mirrored = _cells.mirrored(optics.camera)
    even = mirrored, mirrored and symmetric(optics.array)
    square = mirrored and cells.size[0] == cells.size[1]
    wanted = [place for place, source, _ in alike(places(optics), even, square) if place is source]
    points, samples = math.prod(cells.points), math.prod(cells.samples)
    block = 4.0 * points * samples
    factors = (1.3 * len(wanted) + 0.7 * len(places(optics))) * math.sqrt(points)  # of a block
    # Small lenslets diffract more widely, and so do the gaps between discs.
    factors /= optics.array.fill_factor * (0.5 if optics.array.shape == "round" else 1.0)
    held = factors * math.prod(2 * n + 1 for n in near) * 4.0 * (points + samples)
    if not optics.straight:
        few, inside = (
            Few.of(optics),
            0.6 * cells.kinds * math.sqrt(points) * math.prod(2 * n + 1 for n in optics.reach),
        )
        held += inside * 4.0 * (points + samples)
        return few.table + max(few.fields + workers * (few.line + 5 * block), few.border) + held
    states = {INSIDE} | states_of(wanted)
    light = len({state.x for state in states}) * optics.images_bytes(near)
    kept = 1 + sum(INFINITE in state for state in states)
    return held + workers * (2 * kept + 4) * block + light


@dataclass(frozen=True, slots=True)
class Few:
    """What is computed of few points behind lenslets that are not square.

    Parameters
    ----------
    table
        Light in a lenslet, of all points around it [bytes].
    fields, line
        Fields of the few points, and of all of one row of cells [bytes].
    border
        Images of the chosen points with some lenslets missing [bytes].
    operations
        Multiplications and additions of all fields and images.
    """

    table: float
    fields: float
    line: float
    border: float
    operations: float

    @classmethod
    def of(cls, optics: Optics) -> "Few":
        """Of one depth."""
        cells, axes, kinds = optics.cells, optics.axes, optics.cells.kinds
        samples, pitch = math.prod(cells.samples), optics.array.lattice.pitch
        squared = optics.camera.wavelength * _cells.telecentric_distance(optics.camera)
        light = math.prod(2 * axis.band * pitch + 10 for axis in axes)
        modes = [pitch * axis.size / squared + 9 for axis in axes]
        points = math.prod((2 * optics.lit / axis.size + 1) * axis.points for axis in axes)
        folded = 2.0 if _cells.mirrored(optics.camera) else 1.0
        few, near = math.prod(optics.few(optics.reach)) / folded, math.prod(optics.few(optics.near))
        lit = math.pi * optics.lit**2 / math.prod(cells.size)
        rows = 2 * optics.lit / axes[0].size
        # To the few numbers behind each lenslet and along x, then along y: 8 for a complex product and sum.
        along_x = lit * (light * math.prod(modes) + math.prod(modes) * axes[1].samples)
        along_y = rows * modes[0] * samples
        states = states_of(places(optics))
        turns = len({(state.x, state.kind) for state in states})
        return cls(
            8.0 * light * points,
            8.0 * samples * few,
            8.0 * samples * axes[0].points * optics.few(optics.reach)[1],
            near * (16.0 * rows * modes[0] * axes[1].samples + 4.0 * 8 * samples),
            8.0 * (kinds * few * (along_x + along_y) + near * (turns * along_x + len(states) * along_y)),
        )


def build_operations(optics: Optics) -> float:
    """Multiplications and additions that most of building takes, behind lenslets that are not square."""
    if optics.straight:
        return 0.0
    points, samples = math.prod(optics.cells.points), math.prod(optics.cells.samples)
    # Factors of blocks: three products of theirs, each block and its mirror image once.
    blocks = optics.cells.kinds * math.prod(2 * n + 1 for n in optics.reach) / 2
    return Few.of(optics).operations + 3 * 2.0 * blocks * points**2 * samples


def states_of(group: Iterable[Place]) -> set[State]:
    """Lenslets whose light some places need."""
    return {state for place in group for state in terms(place)}


def symmetric(array: LensletArray) -> bool:
    """Whether a lenslet's surroundings are the same in a mirror."""
    return array.lattice.kinds == 1 or isinstance(array.focal_length, float)
