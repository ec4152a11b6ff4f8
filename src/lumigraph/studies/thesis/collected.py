"""All experiments: their modules are imported, and each registers itself."""

import difflib
import re
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from lumigraph.errors import LumigraphError
from lumigraph.studies.thesis import beyond, figures, microscope, registry
from lumigraph.studies.thesis.registry import Experiment


@cache
def _discover() -> None:
    for package in (figures, beyond, microscope):
        for module in iter_modules(package.__path__):
            import_module(f"{package.__name__}.{module.name}")


def experiments() -> tuple[Experiment, ...]:
    """All experiments, by chapter and number."""
    _discover()
    return tuple(sorted(registry.REGISTERED.values(), key=lambda one: natural_order(one.id)))


def natural_order(id: str) -> tuple[tuple[int, ...], str]:  # noqa: A002
    """Sorting key of an id: its numbers, then its words.

    Examples
    --------
    >>> sorted(["table-3.1", "2.11", "2.4", "figure-3.2"], key=natural_order)
    ['2.4', '2.11', 'table-3.1', 'figure-3.2']
    """
    return tuple(int(number) for number in re.findall(r"\d+", id)), id


def find(ids: Iterable[str]) -> tuple[Experiment, ...]:
    """The experiments with these ids or endings of ids ("5.4" finds "table-5.4"); all for no ids.

    Raises
    ------
    LumigraphError
        An id that nothing matches; the message names the nearest ones.
    """
    known = {one.id: one for one in experiments()}
    wanted: dict[str, Experiment] = {}
    for text in ids:
        matches = [name for name in known if name == text or name.endswith(f"-{text}")]
        if not matches:
            near = _near(text, list(known))
            raise LumigraphError(f"there is no experiment {text!r}. Near ones: {', '.join(near)}.")
        wanted |= {name: known[name] for name in matches}
    chosen = wanted or known
    return tuple(chosen[name] for name in sorted(chosen, key=natural_order))


def _near(text: str, known: list[str]) -> list[str]:
    """Three ids that look or count like the text."""
    close = difflib.get_close_matches(text, known, n=3, cutoff=0.5)
    numbers = re.findall(r"\d+", text)
    same = [name for name in known if numbers and re.findall(r"\d+", name)[:1] == numbers[:1]]
    return list(dict.fromkeys([*close, *same, *known]))[:3]
