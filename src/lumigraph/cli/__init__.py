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

from lumigraph.cli.app import main

__all__ = ["main"]
