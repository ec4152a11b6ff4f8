"""The command line: `lumigraph VERB ...`, one file per verb.

- `app`: the verbs and `main`, which turns every error into one line and an exit code
- `options`: what verbs share: `--json`, `--debug`, quantities with units
- `files`: reading inputs, checking outputs before a computation, writing them
- `console`: results on standard output, progress on standard error
- `reporting`: `--report` of every verb that computes
- `serving`: where a page is served, and opening a browser
- `process`, `demo`, `design`, `simulate`, `calibrate`, `decode`, `render`, `refocus`, `depth`, `deconvolve`,
  `wavefront`, `measure`, `batch`, `sweep`, `dataset`, `board`, `chart`, `view`, `samples`, `catalogue`,
  `reproduce`: the verbs

Modules of verbs import what is slow inside their functions, so that `--help` answers at once.
"""

TYPE_CHECKING = False  # nothing is imported here: Python prints a traceback for Ctrl-C until `main` runs
if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: "Sequence[str] | None" = None) -> int:
    """Run the command line and return its exit code, see `app.main`; Ctrl-C while it starts is quiet, too."""
    try:
        import signal

        # The system's own way ends without a traceback, which imports would print.
        ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler and _is_main_thread()
        if ours:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        _fill_closed()
        from lumigraph.cli import app, console

        if not ours:
            return app.main(arguments)
        with console.interrupts():
            return app.main(arguments)
    except KeyboardInterrupt:
        return 130


def _is_main_thread() -> bool:
    import threading

    return threading.current_thread() is threading.main_thread()


def _fill_closed() -> None:
    """Open what the shell has closed (`2>&-`): else a file would be number 2, into which libraries print."""
    import os
    from contextlib import suppress

    with suppress(OSError):
        while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass
        os.close(number)
