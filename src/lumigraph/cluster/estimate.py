"""Estimate of the time, memory and disk space that the rest of a job needs: `Estimate`."""

import heapq
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from lumigraph.cluster.entry import Entry
from lumigraph.core import memory
from lumigraph.errors import SamplingError


@dataclass(frozen=True, slots=True)
class Estimate:
    """Needs of the rest of a job, from the frames that are done.

    Parameters
    ----------
    frames
        Still to do.
    seconds
        Time of all workers together, side by side [s].
    memory
        Memory of one worker [bytes].
    size
        Size on the disk [bytes].
    noun
        Name of an item.
    busy
        Processor time of all workers together [s].
    """

    frames: int
    seconds: float
    memory: int
    size: int
    noun: str = "frame"
    busy: float = 0.0

    @classmethod
    def of(
        cls,
        entries: Iterable[Entry],
        frames: int,
        workers: int,
        *,
        processors: float = math.inf,
        starting: float = 0.0,
    ) -> "Estimate":
        """Estimate from entries of similar frames; the first one of each worker includes its set-up.

        Parameters
        ----------
        entries
            Entries in the order in which they ended.
        frames
            Still to do.
        workers
            Number of workers. Those with an entry are ready; the others make what they keep first.
        processors
            Processors that all workers share: a frame alone may use several. Infinite if unknown.
        starting
            Time until a worker begins [s].
        """
        known = list(entries)
        first: dict[str, Entry] = {}
        later = [one for one in known if first.setdefault(one.where, one) is not one]
        usual = later or [min(known, key=lambda one: one.seconds)]
        seconds, busy = fmean(one.seconds for one in usual), fmean(one.busy for one in usual)
        late = starting + max(max(one.seconds for one in first.values()) - seconds, 0.0)
        made = max(max(one.busy for one in first.values()) - busy, 0.0)
        others = min(workers, frames) - 1
        ready = min(len(first) - 1, others)
        busy = frames * busy + (others - ready) * made
        ends = _side_by_side(frames, seconds, ready * [0.0] + (others - ready) * [late])
        memory, size = max(one.memory for one in known), fmean(one.size for one in known)
        return cls(frames, max(ends, busy / processors), memory, round(frames * size), busy=busy)

    def __str__(self) -> str:
        frames = f"{self.frames} {many(self.noun, self.frames)}"
        return (
            f"{frames} to do: about {duration(self.seconds)}, {memory.told(self.memory)} a worker, "
            f"{memory.told(self.size)} on the disk"
        )

    def require(self, workers: int, output: Path) -> None:
        """Refuse what cannot fit.

        Raises
        ------
        SamplingError
            More memory or disk than there is, and how many workers would fit.
        """
        whole = memory.total()
        if whole is not None and self.memory * workers > whole:
            fitting = max(whole // max(self.memory, 1), 1)
            raise SamplingError(
                f"{workers} workers need {self.memory * workers / 2**30:.3g} GiB but the machine has "
                f"{whole / 2**30:.3g} GiB. Use at most {fitting}."
            )
        memory.require_disk(
            self.size, output.parent, f"{self.frames} {many(self.noun, self.frames)}", SamplingError
        )


def _side_by_side(frames: int, seconds: float, late: list[float]) -> float:
    """When the last of so many frames ends, by one worker who is ready and others who begin late.

    Each of them is given a frame at once, and the next one when it is done.

    >>> _side_by_side(4, 2.0, [3.0]), _side_by_side(2, 1.0, [9.0])
    (6.0, 10.0)
    """
    ends = [0.0, *(start + seconds for start in late)]
    heapq.heapify(ends)
    for _ in range(frames - len(late)):
        heapq.heapreplace(ends, ends[0] + seconds)
    return max(ends)


def duration(seconds: float) -> str:
    """A time in words.

    >>> duration(42.0), duration(150.0)
    ('42 s', '2.5 minutes')
    """
    return f"{seconds / 60:.1f} minutes" if seconds > 90 else f"{seconds:.0f} s"


def many(noun: str, count: int) -> str:
    """A noun's plural.

    >>> many("run of 16 frames", 2), many("frame", 1)
    ('runs of 16 frames', 'frame')
    """
    first, *rest = noun.split(" ")
    return " ".join([first + "s" * (count != 1), *rest])
