"""Memory that the periodic operator's matrices take while they are built, and what is built together."""

import math
from collections.abc import Iterable, Sequence

from lumigraph.elements import LensletArray
from lumigraph.operators import cells as _cells
from lumigraph.operators.cell_response import INFINITE
from lumigraph.operators.optics import Optics
from lumigraph.operators.places import INSIDE, Place, State, alike, places, terms

TOGETHER = 2.0**30
"""Light that is held while the border's blocks are made of it [bytes], where lenslets are not square."""


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
    if optics.straight:
        states = {INSIDE} | {state for place in wanted for state in terms(place)}
        light = len({state.x for state in states}) * optics.images_bytes(near)
    else:
        states = max((states_of(group) for group in together(optics, wanted)), key=len, default={INSIDE})
        light = max(1, len(states)) * (optics.images_bytes(near) + workers * optics.line_bytes(near))
        light += 2 * min(workers, len(states)) * optics.core_bytes
    kept = 1 + sum(INFINITE in state for state in states)
    return held + workers * (2 * kept + 4) * block + light


def build_operations(optics: Optics) -> float:
    """Multiplications and additions that most of building takes, behind lenslets that are not square."""
    if optics.straight:
        return 0.0
    mirrored = _cells.mirrored(optics.camera)
    even = mirrored, mirrored and symmetric(optics.array)
    wanted = [place for place, source, _ in alike(places(optics), even, False) if place is source]
    count, before = optics.cells.kinds * math.prod(optics.few(optics.reach)), set()
    for group in together(optics, wanted):
        states = states_of(group)
        count += len(states - before) * math.prod(optics.few(optics.near))
        before = states
    return count * optics.core_bytes  # a complex product and sum: 8 operations; a complex number: 8 bytes


def states_of(group: Iterable[Place]) -> set[State]:
    """Lenslets whose light some places need."""
    return {state for place in group for state in terms(place)}


def together(optics: Optics, wanted: Sequence[Place]) -> list[list[Place]]:
    """Places that are done together: kind by kind, as many as `TOGETHER` holds the light of."""
    if optics.straight:
        return [list(wanted)]
    groups: list[list[Place]] = []
    for place in sorted(wanted, key=lambda place: place.state[::-1]):
        if not groups or len(states_of([*groups[-1], place])) * optics.images_bytes(optics.near) > TOGETHER:
            groups.append([])
        groups[-1].append(place)
    return groups


def symmetric(array: LensletArray) -> bool:
    """Whether a lenslet's surroundings are the same in a mirror."""
    return array.lattice.kinds == 1 or isinstance(array.focal_length, float)
