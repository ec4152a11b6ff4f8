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

from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code, see `app.main`; Ctrl-C while it starts is quiet, too."""
    try:
        from lumigraph.cli import app

        return app.main(arguments)
    except KeyboardInterrupt:
        return 130
