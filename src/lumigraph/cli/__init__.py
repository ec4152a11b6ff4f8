"""The command line: `lumigraph VERB ...`, one file per verb.

- `app`: the verbs and `main`, which turns every error into one line and an exit code
- `options`: what verbs share: `--json`, `--debug`, quantities with units
- `files`: reading inputs, checking outputs before a computation, writing them
- `console`: results on standard output, progress on standard error
- `reporting`: `--report` of every verb that computes
- `serving`: where a page is served, and opening a browser
- `demo`, `design`, `simulate`, `calibrate`, `decode`, `render`, `refocus`, `depth`, `deconvolve`, `view`,
  `reproduce`: the verbs

Modules of verbs import what is slow inside their functions, so that `--help` answers at once.
"""

import os
import signal
import threading
from collections.abc import Sequence
from contextlib import suppress

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code, see `app.main`; Ctrl-C while it starts is quiet, too."""
    _fill_closed()
    handler = signal.getsignal(signal.SIGINT)
    ours = handler is signal.default_int_handler and threading.current_thread() is threading.main_thread()
    try:
        if ours:  # the system's own way ends without a traceback, which imports would print
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        from lumigraph.cli import app

        if ours:
            signal.signal(signal.SIGINT, handler)
        return app.main(arguments)
    except KeyboardInterrupt:
        return 130


def _fill_closed() -> None:
    """Open what the shell has closed (`2>&-`): else a file would be number 2, into which libraries print."""
    with suppress(OSError):
        while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass
        os.close(number)
