"""Telling where a page is, and opening a browser."""

import sys
from typing import Annotated

from cyclopts import Parameter

from lumigraph.cli.console import line, report
from lumigraph.cli.options import Common
from lumigraph.errors import FormatError

MOST_PORT = 65535

Port = Annotated[int, Parameter(allow_leading_hyphen=True)]


def check_port(port: int) -> None:
    """Refuse a port that no computer has."""
    if not 0 <= port <= MOST_PORT:
        raise FormatError(f"--port is {port} but must be from 1 to {MOST_PORT}, or 0 for a free one.")


def announce(address: str, common: Common, *, no_open: bool) -> None:
    """Print a page's address on one line, and open a browser there unless --no-open is given.

    The browser is given a file that leads there: what stands in its command line all users can read.
    """
    report(common, address, {"address": address})
    sys.stdout.flush()
    if not no_open:
        from lumigraph.viewer.show import open_in_browser

        open_in_browser(address, line)
