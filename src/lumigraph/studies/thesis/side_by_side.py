"""Experiments on several processors, those of a chapter that share a camera in one process."""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from lumigraph.core.threads import single_products
from lumigraph.studies.thesis.collected import find, natural_order
from lumigraph.studies.thesis.registry import Experiment
from lumigraph.studies.thesis.run import StoredResult, run


def groups(chosen: Sequence[Experiment]) -> list[tuple[str, ...]]:
    """Ids of experiments to be run by one process, largest groups first.

    Experiments of a chapter with one camera share its operators and images, those without stand alone.

    Examples
    --------
    >>> from lumigraph.studies.thesis import find
    >>> groups(find(["table-3.1", "2.34", "table-3.2"]))
    [('table-3.1', 'table-3.2'), ('2.34',)]
    """
    found: dict[str, list[str]] = {}
    for one in chosen:
        shared = f"{one.camera} {natural_order(one.id)[0][:1]}" if one.camera else one.id
        found.setdefault(shared, []).append(one.id)
    return sorted((tuple(ids) for ids in found.values()), key=len, reverse=True)


def run_side_by_side(
    chosen: Sequence[Experiment],
    folder: Path,
    workers: int,
    *,
    quick: bool = False,
    fresh: bool = False,
    finished: Callable[[StoredResult], None] | None = None,
) -> Iterator[list[StoredResult]]:
    """Results so far, in the order of `chosen`, whenever a process has finished a group; see `run`."""
    done: dict[str, StoredResult] = {}
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context)
    try:
        running = [pool.submit(_run, ids, folder, quick, fresh) for ids in groups(chosen)]
        for one in as_completed(running):
            for result in one.result():
                done[result.id] = result
                if finished is not None:
                    finished(result)
            yield [done[each.id] for each in chosen if each.id in done]
    finally:
        pool.shutdown(cancel_futures=True)


def _run(ids: tuple[str, ...], folder: Path, quick: bool, fresh: bool) -> list[StoredResult]:
    """Results of a group, computed in a process of its own."""
    wanted = [one for one in find(ids) if one.id in ids]
    with single_products():
        return run(wanted, folder, quick=quick, fresh=fresh)
