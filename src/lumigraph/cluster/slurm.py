"""A job array of SLURM that does a batch, each of its jobs an equal part of the frames."""

import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from lumigraph import store
from lumigraph.cluster.ledger import Ledger, require_free
from lumigraph.core.printable import has_controls, printable
from lumigraph.errors import LumigraphError


def script(
    command: Sequence[str], output: Path, jobs: int, options: Sequence[str] = (), folder: Path | None = None
) -> str:
    """Batch script for `sbatch`.

    Parameters
    ----------
    command
        Command that does a part, which its last word names: ``K/jobs`` is put behind it.
    output
        Output of the batch; what jobs print goes beside its ledger.
    jobs
        Number of jobs in the array.
    options
        More of sbatch's, such as ``--time=2:00:00``.
    folder
        Where the command runs; the present one if left out.

    Raises
    ------
    LumigraphError
        A control character in any of them: a line break would begin a line of the script.
    """
    where = str(folder or Path.cwd())
    named = [("output", str(output.absolute())), ("folder", where)]
    named += [("command", one) for one in command] + [("option of sbatch", one) for one in options]
    for what, text in named:
        if has_controls(text):
            raise LumigraphError(
                f"the {what} {printable(text)} has a control character, which no script of SLURM takes. "
                "Give it another name."
            )
    place = Ledger.beside(output.absolute()).folder
    heads = [
        f"--job-name=lumigraph-{output.name}",
        f"--array=1-{jobs}",
        f"--output={str(place).replace('%', '%%')}/job-%A-%a.log",
        *options,
    ]
    lines = ["#!/bin/sh", *(f"#SBATCH {shlex.quote(head)}" for head in heads)]
    lines += [f"cd {shlex.quote(where)} || exit 1"]
    lines += [f'exec {shlex.join(command)} "$SLURM_ARRAY_TASK_ID/{jobs}"']
    return "\n".join(lines) + "\n"


def submit(text: str, output: Path) -> str:
    """Hand a script to SLURM; gives the number of the job.

    Raises
    ------
    LumigraphError
        There is no `sbatch` here, it refuses the script, or the output is somebody else's.
    """
    if shutil.which("sbatch") is None:
        raise LumigraphError("there is no sbatch here. Run this on a machine that hands jobs to SLURM.")
    require_free(output)
    place = Ledger.beside(output.absolute()).folder
    place.mkdir(parents=True, exist_ok=True)
    store.write_bytes(place / "job.sh", text.encode())
    run = subprocess.run(
        ["sbatch", "--parsable", str(place / "job.sh")], capture_output=True, text=True, check=False
    )
    if run.returncode:
        raise LumigraphError(f"sbatch refuses the job: {' '.join(run.stderr.split())[:300]}")
    return run.stdout.strip().partition(";")[0]
