"""`lumigraph batch`: another verb for each of many frames."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli import files, standing
from lumigraph.cli.console import line, progress
from lumigraph.cli.frames import KINDS, Frames, items_of, runs
from lumigraph.cli.options import COMMAND, COMMON, Common, Output, section
from lumigraph.cli.standing import StatusPage
from lumigraph.core import memory
from lumigraph.core.result import Quantity, Result
from lumigraph.errors import FormatError, LumigraphError

if TYPE_CHECKING:
    from lumigraph.cluster import Cluster, Report
    from lumigraph.io import tables

SERIES, TABLES = (".zarr",), (".csv", ".parquet")


RUN = 16
"""Frames in a row of warm starts."""

_STATUS = "status"
_SHOWN = 5
"""Number of failures that are listed one by one."""


@Parameter(name="*", group=section("Workers"))
@dataclass(frozen=True)
class WorkerOptions:
    """Workers that do the job.

    Parameters
    ----------
    workers
        Processes on this machine; one for each processor if left out.
    scheduler
        Address of a running dask cluster instead, such as tcp://10.0.0.1:8786, or tls:// with dask's own
        configuration of certificates. A cluster without them trusts everybody who reaches its port.
    slurm
        Submit to SLURM instead, as an array of so many jobs.
    sbatch
        More options of those jobs, such as "--time=2:00:00 --mem=8G".
    part
        Part of the frames to do, of how many equal ones, such as 3/10, as the jobs of a queue share them.
    """

    workers: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    scheduler: str | None = None
    slurm: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    sbatch: Annotated[str, Parameter(allow_leading_hyphen=True)] = ""
    part: str | None = None

    def check(self) -> None:
        """Refuse what contradicts itself."""
        if sum(one is not None for one in (self.workers, self.scheduler)) > 1:
            raise FormatError("--workers and --scheduler exclude each other. Give one of them.")
        if self.slurm is not None and (self.slurm < 1 or self.part or self.scheduler):
            raise FormatError("--slurm is a number of jobs above 0, without --part and --scheduler.")
        if self.sbatch and self.slurm is None:
            raise FormatError("--sbatch is for the jobs of --slurm. Give both.")

    def submitted(self, output: Path) -> Result:
        """Hand the same command to a queue, a part to each job."""
        import shlex

        from lumigraph.cluster import slurm

        command = [sys.executable, "-m", "lumigraph", *_without(COMMAND.get(), ("--slurm", "--sbatch"))]
        jobs = self.slurm or 1
        number = slurm.submit(
            slurm.script([*command, "--part"], output, jobs, shlex.split(self.sbatch)), output
        )
        values = (Quantity("job", number), Quantity("jobs", jobs))
        told = f"job {number} of SLURM: {jobs} parts; 'lumigraph batch status {output}' shows how it stands"
        return Result("Batch", "A job array.", number, (told,), values)

    def cluster(self) -> "Cluster":
        """Cluster of the workers."""
        from lumigraph import cluster
        from lumigraph.core.arrays import WORKERS

        if self.workers is not None and self.workers < 1:
            raise FormatError(f"--workers is {self.workers} but must be at least 1.")
        if self.scheduler is not None:
            return cluster.Dask(self.scheduler)
        return cluster.Local(self.workers or WORKERS)

    def share(self) -> tuple[int, int]:
        """The part, and of how many."""
        try:
            number, parts = map(int, (self.part or "1/1").split("/"))
        except ValueError:
            raise FormatError(f"--part is {self.part!r} but must be like 3/10.") from None
        return number, parts


def batch(
    verb: str,
    /,
    *words: Annotated[str, Parameter(allow_leading_hyphen=True)],
    output: Output | None = None,
    page: str | None = None,
    run: Annotated[int, Parameter(allow_leading_hyphen=True)] = RUN,
    hands: WorkerOptions = WorkerOptions(),
    common: Common = COMMON,
) -> Result:
    """Run another verb for each of many frames: pages of a stack, or files by a pattern.

    The results become one Zarr store (volumes: OME-Zarr), which napari and others open while it grows;
    those of 'measure' and 'calibrate' a table. Finished frames are recorded beside it. Safe to interrupt: run
    the same command again to resume. Frames that fail are recorded, left out, and tried again then.

    Example: `lumigraph batch deconvolve film.tif --white white.tif --camera scope.toml --iterations 8 -o volumes.ome.zarr`

    Example: `lumigraph batch refocus "raws/*.png" --white white.png --alpha 0.95 -o pictures.zarr --workers 2`

    Example: `lumigraph batch status volumes.ome.zarr`

    Parameters
    ----------
    verb
        simulate, decode, render, refocus, depth, deconvolve, calibrate or measure; or status.
    words
        Arguments of the verb: files or patterns in quotes first, then its options.
    output
        Zarr store (.zarr), or table (.csv, .parquet).
    page
        Pages of a stack, such as '3:9', '3-9' or 3, counted from 0; all if left out.
    run
        Number of frames in a row for one worker with the --warm of 'deconvolve', the first one cold: more are
        better for the last ones, fewer for many workers.
    """  # noqa: E501 - an example is one line
    from lumigraph import cluster

    if verb == _STATUS:
        return _told(cluster.status(_only(words)), ())
    if verb not in KINDS:
        raise FormatError(f"batch takes {', '.join(KINDS)} or {_STATUS}, not {verb!r}.")
    if output is None:
        raise FormatError("no output is given. Add --output FILE.")
    kind = KINDS[verb]
    hands.check()
    files.check_output(output, TABLES if kind.is_table else SERIES)
    if kind.is_table:
        require_table(output)
    paths, options = _split(words, kind.leading)
    items = list(items_of(paths, None if kind.is_table or verb == "simulate" else page or "all"))
    work, what = Frames(verb, options, str(Path.cwd())), {"verb": verb, "options": list(options)}
    first = items[0]
    if verb == "deconvolve" and "--warm" in options:
        items, what = runs(items, run), {**what, "run": run}
    work.check(first)
    if hands.slurm is not None:
        return hands.submitted(output)
    workers, part = hands.cluster(), hands.share()
    with progress("batch") as shown, kept(output):
        line(f"how it stands: {cluster.page(output)}")
        found = cluster.batch(
            work, items, output, what=what, inputs=work.inputs(first), workers=workers, part=part,
            progress=StatusPage(output, shown),
            estimated=lambda needed: line(str(needed)),
        )  # fmt: skip
    if kind.is_table:
        save_table(output)
    if found.failures:
        raise LumigraphError(f"{_failures(found)} {found.done} of {found.count} are in {output}.")
    return _told(found, (output,))


@contextmanager
def kept(output: Path) -> Iterator[None]:
    """Context in which Ctrl-C says what is done already; at its end the page says that it has ended."""
    try:
        yield
        standing.write(output)
    except KeyboardInterrupt:
        from lumigraph import cluster

        try:
            found = cluster.status(output)
            standing.write(output)
        except FormatError:  # it had not begun
            raise KeyboardInterrupt from None
        told = f"{found.stand} are in {output}. The same line goes on."
        raise KeyboardInterrupt(told) from None


def _without(words: Sequence[str], names: Sequence[str]) -> Iterator[str]:
    """Words without some options and the value of each."""
    rest = iter(words)
    for word in rest:
        if word in names:
            next(rest, None)
        elif word.partition("=")[0] not in names:
            yield word


def _split(words: Sequence[str], leading: int) -> tuple[list[str], tuple[str, ...]]:
    """Files and patterns, which stand before the first option, and the verb's other words."""
    first = next((k for k, word in enumerate(words) if word.startswith("-")), len(words))
    if first <= leading:
        raise FormatError("no frames are given. Name files, or a pattern in quotes, after the verb.")
    return list(words[leading:first]), (*words[:leading], *words[first:])


def require_table(output: Path, axes: "tables.Axes | None" = None) -> None:
    """Refuse a table that cannot be written, before any work."""
    from lumigraph.io import tables

    tables.require(output, axes)


def save_table(output: Path, axes: "tables.Axes | None" = None) -> None:
    """Write what is in the ledger; jobs that end at once wait for each other."""
    from lumigraph import cluster
    from lumigraph.io import tables

    with cluster.rows(output) as rows:
        tables.save(output, rows, axes)


def _only(words: Sequence[str]) -> Path:
    if len(words) != 1:
        raise FormatError("status takes the output of a batch, and nothing else.")
    return Path(words[0])


def _failures(found: "Report") -> str:
    """Number of failed frames, and the first reasons, each with its first frames."""
    reasons: dict[str, list[int]] = {}
    for number, why in sorted(found.failures.items()):
        reasons.setdefault(why.rstrip("."), []).append(number)
    named = [f"{_numbers(numbers)}: {why}" for why, numbers in list(reasons.items())[:_SHOWN]]
    more = len(reasons) - len(named)
    tail = f" ... and {more} more reasons" if more > 0 else ""
    return f"{len(found.failures)} of {found.stand.partition(' of ')[2]} failed. {'; '.join(named)}{tail}."


def _numbers(numbers: list[int]) -> str:
    """Numbers of frames as text.

    >>> _numbers([7]), _numbers([1, 2]), _numbers(list(range(10)))
    ('frame 7', 'frames 1, 2', 'frames 0, 1, 2, 3, 4 and 5 more')
    """
    first, more = ", ".join(map(str, numbers[:_SHOWN])), len(numbers) - _SHOWN
    return f"frame{'s' * (len(numbers) > 1)} {first}" + (f" and {more} more" if more > 0 else "")


def _told(found: "Report", written: tuple[Path, ...]) -> Result:
    entries = list(found.entries.values())
    failed = len(found.failures)
    values = [Quantity("frames", found.count), Quantity("done", found.done), Quantity("failed", failed)]
    lines = [f"{found.stand} are done"]
    if entries:
        middle = sorted(entry.seconds for entry in entries)[len(entries) // 2]
        size, most = sum(entry.size for entry in entries), max(entry.memory for entry in entries)
        values += [
            Quantity("seconds_a_frame", middle, "s"),
            Quantity("bytes", size),
            Quantity("memory", most),
        ]
        lines.append(
            f"{middle:.3g} s a {found.noun}, {memory.told(size)}, at most {memory.told(most)} a worker"
        )
    lines += [f"how it stands, as a page: {found.page}"] if found.page else []
    lines += [_failures(found)] if failed else []
    notes = tuple(dict.fromkeys(note for entry in entries for note in entry.notes))[:_SHOWN]
    extra = {"failures": {str(number): why for number, why in found.failures.items()}}
    return Result(
        "Batch", "Many frames, and what was made of each.", found, tuple(lines), tuple(values), notes=notes,
        written=written, extra=extra,
    )  # fmt: skip
