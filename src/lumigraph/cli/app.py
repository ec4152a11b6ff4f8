"""The verbs, and `main`, which turns every error into one line and an exit code."""

import inspect
import os
import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from importlib.metadata import version
from typing import get_args

from cyclopts import App, Group
from cyclopts.exceptions import CycloptsError, MissingArgumentError, UnknownCommandError

from lumigraph.cli.align import align
from lumigraph.cli.batch import batch
from lumigraph.cli.board import board
from lumigraph.cli.calibrate import calibrate
from lumigraph.cli.catalogue import catalogue
from lumigraph.cli.chart import chart
from lumigraph.cli.convert import convert
from lumigraph.cli.dataset import dataset
from lumigraph.cli.datasheet import datasheet
from lumigraph.cli.decode import decode
from lumigraph.cli.deconvolve import deconvolve
from lumigraph.cli.demo import demo
from lumigraph.cli.depth import depth
from lumigraph.cli.design import design
from lumigraph.cli.information import information
from lumigraph.cli.measure import measure
from lumigraph.cli.optimise import optimise
from lumigraph.cli.options import COMMAND, PARAMETER, RENAMED, WARNED
from lumigraph.cli.process import process
from lumigraph.cli.refocus import refocus
from lumigraph.cli.render import render
from lumigraph.cli.reporting import telling
from lumigraph.cli.reproduce import reproduce
from lumigraph.cli.samples import samples
from lumigraph.cli.simulate import simulate
from lumigraph.cli.sweep import sweep
from lumigraph.cli.tolerance import tolerance
from lumigraph.cli.twin import twin
from lumigraph.cli.view import is_shown, view
from lumigraph.cli.wavefront import wavefront
from lumigraph.core.printable import printable, printable_lines
from lumigraph.errors import LumigraphError

FAILED, USAGE, INTERRUPTED = 1, 2, 130
"""Exit codes: something went wrong, the command was written wrongly, Ctrl-C."""

_LONGEST = 400  # characters of a line on standard error

GROUPS = {
    "Every day": (process, view, calibrate, decode, render, refocus, depth, deconvolve, simulate),
    "Design and study": (design, information, optimise, tolerance, sweep, wavefront),
    "Bench and metrology": (measure, board, chart, datasheet, twin, align),
    "Many frames": (batch, dataset, convert),
    "Samples and thesis": (demo, samples, catalogue, reproduce),
}
"""Verbs by what people do, the everyday ones first."""

VERBS = tuple(verb for group in GROUPS.values() for verb in group)
"""All verbs."""


app = App(
    name="lumigraph",
    help="Design, simulate and process light-field (plenoptic) cameras.\n\n"
    "`lumigraph FILE` shows a file in the browser. Lengths carry their unit, such as '150 um'. "
    "Every verb takes --json and --debug.",
    version=lambda: version("lumigraph"),
    help_format="markdown",
    suppress_keyboard_interrupt=False,
    result_action="return_value",
    default_parameter=PARAMETER,
    group_commands=Group("The program", sort_key=len(GROUPS)),
    group_arguments=Group("Arguments", sort_key=-2),
    group_parameters=Group("Parameters", sort_key=-1),
)
for _place, (_title, _verbs) in enumerate(GROUPS.items()):
    _group = Group(_title, sort_key=_place)
    for _number, _verb in enumerate(_verbs):
        app.command(telling(_verb), sort_key=_number, group=_group)
app.register_install_completion_command(
    help="Complete verbs and options on Tab: writes a file for your shell, and a line to its start-up file."
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; 0 only on success.

    Parameters
    ----------
    arguments
        Without the program's name; those the program was started with if left out.
    """
    words = _viewed(list(sys.argv[1:] if arguments is None else arguments))
    debug = "--debug" in words
    COMMAND.set(tuple(words))
    WARNED.set([])
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            app(words, exit_on_error=False, print_error=False)
            if sys.stdout is not None:  # closed by the shell: `>&-`
                sys.stdout.flush()
            return 0
        except BrokenPipeError:  # the reader, such as `head`, has seen enough
            _discard_output()
            return 0
        except (Exception, KeyboardInterrupt) as error:
            if debug:
                print(printable_lines(traceback.format_exc()), file=sys.stderr)
            if isinstance(error, OSError):  # the output may be what failed, and Python would write it again
                _discard_output()
            code, text = _explained(error)
            _say(text)
            return code


def _explained(error: BaseException) -> tuple[int, str]:
    """Exit code and one line for an error."""
    match error:
        case KeyboardInterrupt():
            return INTERRUPTED, f"interrupted; {error if error.args else 'no output was written.'}"
        case CycloptsError():
            return USAGE, f"error: {_usage(error)}"
        case LumigraphError():
            return FAILED, f"error: {_optional(str(error))}"
        case MemoryError():
            return FAILED, "error: not enough memory. Use a smaller image, grid or number of samples."
        case OSError():
            where = f"{error.filename}: " if error.filename else ""
            return FAILED, f"error: {where}{error.strerror or error}."
    what = f"{type(error).__name__}: {error}"
    return FAILED, f"error: unexpected {what[:300]}. Run it again with --debug and report the traceback."


def _viewed(words: list[str]) -> list[str]:
    """The words, with `view` before a file that stands in the place of a verb."""
    known = {verb.__name__ for verb in VERBS}
    first = words[0] if words else ""
    return ["view", *words] if first not in known and is_shown(first) else words


def _optional(text: str) -> str:
    """A message with the running verb's options in place of Python's parameters: "--pitch" for "pitch="."""
    verb = next((verb for verb in VERBS if verb.__name__ in COMMAND.get()), None)
    names = set() if verb is None else set(inspect.signature(verb).parameters)

    def option(found: re.Match[str]) -> str:
        name, value = found.groups()
        if name == "views" and verb is not convert:  # of a mosaic: to the command line they are the input
            return f"--mosaic {value}".rstrip()
        return f"--{name}{' ' * bool(value)}{value}" if name in names else found[0]

    if verb is simulate:
        text = text.replace("spectrum=Spectrum.rgb()", "--colours rgb")
    return re.sub(r"\b([a-z_]+)=((?:[\w-]|\.\d)*)", option, text)


def _usage(error: CycloptsError) -> str:
    """Message about a wrong command line, with a pointer to the help."""
    if isinstance(error, UnknownCommandError) and error.unused_tokens:
        return _unknown(error.unused_tokens[0])
    verb = " ".join(error.command_chain or ())
    hint = f"lumigraph {verb} --help".replace("  ", " ")
    text = _renamed(COMMAND.get()) or (
        _missing(error, verb) if isinstance(error, MissingArgumentError) else str(error)
    )
    text = text.rstrip(".")
    return f"{text}{'' if text.endswith('?') else '.'} Try '{hint}'."


def _renamed(words: Sequence[str]) -> str | None:
    """Message with the new name of an option that has another one now; None if there is no such option."""
    if not words or words[0] not in {verb.__name__ for verb in VERBS}:
        return None
    known = {name for one in app[words[0]].assemble_argument_collection() for name in one.names}
    for old in (word.partition("=")[0] for word in words):
        new = next((name for name in RENAMED.get(old, ()) if name in known), None)
        if new is not None and old not in known:
            return f"{old} is now called {new}. Did you mean {new}?"
    return None


def _missing(error: MissingArgumentError, verb: str) -> str:
    """Message about an argument or a value that is missing."""
    if error.argument is None:
        return str(error)
    given = error.keyword or next((token.keyword for token in error.argument.tokens if token.keyword), None)
    if given is not None:
        return f"{given} needs a value"
    names, words = error.argument.names, get_args(error.argument.hint)
    if error.argument.field_info.is_positional:
        choices = f": {' or '.join(words)}" if words and all(isinstance(word, str) for word in words) else ""
        return f"{verb} needs {names[0].lstrip('-').upper()}{choices}"
    short = next((name for name in names if not name.startswith("--")), None)
    return f"{verb} needs {names[0]}{f' ({short})' if short else ''}"


def _unknown(word: str) -> str:
    """A verb that there is not, those that there are, and the nearest."""
    names = [verb.__name__ for verb in VERBS]
    near = get_close_matches(word, names, 1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return f"there is no verb {word!r}.{hint} The verbs are {', '.join(names)}; try 'lumigraph --help'."


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    WARNED.get([]).append(text := _optional(str(message)))
    _say(f"warning: {text}")


def _say(text: str) -> None:
    """One line on standard error, of at most 400 characters: the start and the end of a longer one."""
    line = f"lumigraph: {printable(' '.join(text.split()))}"
    if len(line) > _LONGEST:
        line = f"{line[: _LONGEST - 125]} ... {line[-120:]}"
    if sys.stderr is not None:
        with suppress(OSError):
            print(line, file=sys.stderr)


def _discard_output() -> None:
    """Discard all further output."""
    with suppress(AttributeError, OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
