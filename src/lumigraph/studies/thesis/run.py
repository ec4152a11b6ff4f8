"""Runs experiments one after the other, keeps what is finished, and writes the report."""

import base64
import hashlib
import json
import math
import shutil
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph import store
from lumigraph.core.progress import Progress, Stage, within
from lumigraph.errors import FormatError
from lumigraph.io import png
from lumigraph.io.target import write_bytes
from lumigraph.report.pictures import Picture, picture
from lumigraph.studies.thesis.collected import experiments
from lumigraph.studies.thesis.registry import Context, Experiment, ExperimentOutcome, ResultRow

"""Called with what goes on and the fraction of the whole that is done."""

_RESULT = "result"
"""Name of a stored result: one array, the bytes of its JSON."""

_COLOURS = 128

_APART = ("cli", "demo", "report", "viewer")
"""Folders of the package that change no number."""


@dataclass(frozen=True, slots=True)
class StoredResult:
    """A finished experiment, as it is stored: rows, pictures ready for a page, and the time it took [s].

    `memory` is the highest memory of the process until its end [byte], 0 where it cannot be known;
    `error` the traceback of an experiment that did not run to its end.
    """

    id: str
    rows: tuple[ResultRow, ...]
    pictures: tuple[Picture, ...]
    why: str
    seconds: float
    memory: int = 0
    error: str = ""
    stored: bool = False

    @property
    def failed(self) -> tuple[ResultRow, ...]:
        """Rows out of tolerance."""
        return tuple(row for row in self.rows if row.passed is False)

    def to_json(self) -> bytes:
        """Everything but `stored`."""
        values = asdict(self)
        del values["stored"]
        return json.dumps(values).encode()

    @classmethod
    def from_json(cls, content: bytes) -> "StoredResult":
        """Result restored from `to_json`."""
        values = json.loads(content)
        values["rows"] = tuple(
            ResultRow(**{**row, "tolerance": _pair(row["tolerance"])}) for row in values["rows"]
        )
        values["pictures"] = tuple(Picture(**one) for one in values["pictures"])
        return cls(**values, stored=True)


def run(
    chosen: Sequence[Experiment],
    folder: Path,
    *,
    quick: bool = False,
    fresh: bool = False,
    progress: Progress | None = None,
    finished: Callable[[StoredResult], None] | None = None,
) -> list[StoredResult]:
    """Run experiments; what an earlier run with the same sources finished is read instead.

    Parameters
    ----------
    chosen
        In this order.
    folder
        Results are kept in ``folder/parts``: the whole of a finished experiment, parts of a long one.
    quick
        Run reduced sizes.
    fresh
        Forget what earlier runs of the chosen experiments kept.
    progress
        Called as ``progress(fraction)`` of all experiments, a `core.progress.Stage`.
    finished
        Called with each result.
    """
    results = []
    for number, one in enumerate(chosen):
        tell = within(progress, number / len(chosen), (number + 1) / len(chosen), one.id)
        tell(Stage(0.0, one.title))
        results.append(_run_or_read(one, folder / "parts", quick, fresh, tell))
        if finished is not None:
            finished(results[-1])
    return results


def _run_or_read(one: Experiment, folder: Path, quick: bool, fresh: bool, tell: Progress) -> StoredResult:
    name = f"{one.id}-{'quick' if quick else 'full'}-{sources(one)[:16]}"
    whole, parts = folder / f"{name}.npz", folder / name
    if fresh:
        whole.unlink(missing_ok=True)
        shutil.rmtree(parts, ignore_errors=True)
    with suppress(FormatError, OSError):  # none, or damaged: run again
        return StoredResult.from_json(store.read(whole)[_RESULT].tobytes())
    folder.mkdir(parents=True, exist_ok=True)
    result = _run(one, Context(quick, parts, tell))
    if not result.error:
        store.write(whole, {_RESULT: np.frombuffer(result.to_json(), np.uint8)})
        shutil.rmtree(parts, ignore_errors=True)
    return result


def _run(one: Experiment, context: Context) -> StoredResult:
    """Run an experiment; an error becomes a row that fails, so that the others still run."""
    start, error = time.perf_counter(), ""
    try:
        outcome = one.run(context)
    except Exception as problem:
        error = traceback.format_exc()
        note = f"{type(problem).__name__}: {problem}"
        outcome = ExperimentOutcome((ResultRow("runs to its end", 0.0, expected=1.0, note=note),))
    pictures = tuple(compact(picture(image, caption)) for image, caption in outcome.figures)
    rows = tuple(_plain(row) for row in outcome.rows)
    seconds = time.perf_counter() - start
    return StoredResult(one.id, rows, pictures, outcome.why, seconds, _peak_memory(), error)


def compact(shown: Picture) -> Picture:
    """Picture in 128 colours of its own: a third of the bytes, for grey values and lines alike."""
    start, content = shown.uri.split(",", 1)
    smaller = base64.b64encode(png.in_few_colours(base64.b64decode(content), _COLOURS)).decode()
    return replace(shown, uri=f"{start},{smaller}") if len(smaller) < len(content) else shown


def _plain(row: ResultRow) -> ResultRow:
    """The row with Python's own numbers, which JSON keeps to the last digit."""
    values = {name: _number(getattr(row, name)) for name in ("got", "thesis", "expected")}
    pair = isinstance(row.tolerance, tuple)
    tolerance: Any = tuple(map(_number, row.margins)) if pair else _number(row.tolerance)
    return replace(row, **values, tolerance=tolerance)


def _number(value: Any) -> Any:
    return value if value is None or isinstance(value, str) else float(value)


def _pair(tolerance: Any) -> Any:
    return tuple(tolerance) if isinstance(tolerance, list) else tolerance


def sources(one: Experiment) -> str:
    """Digest of everything that an experiment's numbers follow from: the package, less other experiments."""
    others = {other.module for other in experiments()} - {one.module}
    digest = hashlib.sha256()
    for module, content in _files():
        if module not in others:
            digest.update(content)
    return digest.hexdigest()


@cache
def _files() -> tuple[tuple[str, bytes], ...]:
    """(module, digest) of every source and camera file of the package, and the versions of what it uses."""
    root = Path(__file__).parents[1]
    found = []
    for path in sorted([*root.rglob("*.py"), *root.rglob("*.toml")]):
        parts = path.relative_to(root.parent).with_suffix("").parts
        if parts[1] not in _APART:
            found.append((".".join(parts), hashlib.sha256(path.read_bytes()).digest()))
    used = " ".join(f"{name} {_version(name)}" for name in ("numpy", "scipy", "scikit-image"))
    return (*found, ("", used.encode()))


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # an extra
        return ""


def _peak_memory() -> int:
    """Highest memory of this process so far [byte]; 0 if the system does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def kinds(results: Sequence[StoredResult]) -> dict[str, int]:
    """Number of rows of each kind: proven by waves, closed forms, and told."""
    rows = [row for result in results for row in result.rows]
    return {kind: sum(row.kind == kind for row in rows) for kind in ("waves", "closed form", "told")}


def records(results: Sequence[StoredResult]) -> list[dict[str, Any]]:
    """Rows of all results as dictionaries of plain values; what is not finite becomes None."""
    return [
        {
            "experiment": result.id,
            "quantity": row.quantity,
            "unit": row.unit,
            "thesis": _finite(row.thesis),
            "expected": _finite(row.expected),
            "got": _finite(row.got),
            "tolerance": [_finite(margin) for margin in row.tolerance]
            if isinstance(row.tolerance, tuple)
            else _finite(row.tolerance),
            "passed": row.passed,
            "kind": row.kind,
        }
        for result in results
        for row in result.rows
    ]


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_records(results: Sequence[StoredResult], path: Path) -> None:
    """Write `records` as a JSON file."""
    write_bytes(path, json.dumps(records(results), indent=1, ensure_ascii=False).encode())
