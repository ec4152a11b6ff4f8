"""Progress of a computation: callbacks that receive the fraction done."""

import time
from collections.abc import Callable

Progress = Callable[[float], None]
"""Called with the fraction that is done, from 0 to 1: any function of a number. See `Stage`."""


_FORESEEN = 0.04
"""Fraction of a computation from which the time of all of it is foreseen."""


class Stage(float):
    """Fraction with a description of the current step, for a progress bar.

    >>> fraction = Stage(0.25, "raw image")
    >>> print(fraction, fraction.what)
    0.25 raw image
    """

    what: str

    def __new__(cls, fraction: float, what: str = "") -> "Stage":
        """The fraction with its text."""
        made = super().__new__(cls, fraction)
        made.what = what
        return made


class Needs(Stage):
    """Fraction with what a long computation needs, in time and memory: told before it, and once.

    >>> within(lambda told: print(type(told).__name__, told.what), 0, 1)(Needs(0.0, "300 MiB, about 40 s"))
    Needs 300 MiB, about 40 s
    """


def expected(progress: Progress, least: float) -> Progress:
    """Callback that says once, as soon as it is foreseen, that a computation takes `least` seconds or more.

    >>> told = expected(lambda fraction: print(what_of(fraction)), 0.0)
    >>> told(0.1), told(0.4)  # doctest: +ELLIPSIS
    <BLANKLINE>
    about ... s
    ...
    """
    first: tuple[float, float] | None = None  # what comes before the first step is done once
    said = False

    def tell(fraction: float) -> None:
        nonlocal first, said
        now = time.monotonic()
        if first is None and fraction > 0:
            first = fraction, now
        elif first is not None and not said and _FORESEEN <= fraction - first[0] < 0.5:
            whole = (now - first[1]) / (fraction - first[0])
            if said := whole >= least:
                told = ": ".join(filter(None, (what_of(fraction), f"about {whole:.0f} s")))
                progress(Needs(fraction, told))
                return
        progress(fraction)

    return tell


def silent(fraction: float) -> None:
    """Progress callback that does nothing."""


def within(progress: Progress | None, first: float, last: float, what: str = "") -> Progress:
    """Callback for a part of a computation that runs from `first` to `last` of the whole.

    Parameters
    ----------
    progress
        Callback of the whole.
    first, last
        Fractions of the whole.
    what
        Goes on meanwhile, before what the part itself says.

    >>> within(print, 0.5, 1.0)(0.5)
    0.75
    """

    def tell(fraction: float) -> None:
        if progress is not None:
            text = ": ".join(filter(None, (what, what_of(fraction))))
            place = first + (last - first) * fraction
            kind = Needs if isinstance(fraction, Needs) else Stage
            progress(kind(place, text) if text else place)

    return tell


def part(progress: Progress | None, number: int, count: int) -> Progress:
    """Callback for part `number` of `count` equal parts of a computation.

    >>> part(print, 1, 4)(0.5)
    0.375
    """
    return within(progress, number / count, (number + 1) / count)


def what_of(fraction: float) -> str:
    """Description of the current step that a fraction carries; empty if it carries none."""
    return fraction.what if isinstance(fraction, Stage) else ""
