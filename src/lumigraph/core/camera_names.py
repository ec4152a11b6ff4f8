"""Registry of what loads a camera: verbs below `instruments` take file paths and catalogue names too."""

from os import PathLike

TYPE_CHECKING = False  # `typing` is slow to import, and `import lumigraph` imports this
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_home: "Callable[[], Callable[[Any], Any]] | None" = None


def loaded_by(home: "Callable[[], Callable[[Any], Any]]") -> None:
    """Register the function that loads a camera; `home` gives it when it is first needed."""
    global _home
    _home = home


def camera(given: "Any") -> "Any":
    """The camera of a file path or a catalogue name; anything else as it is.

    Raises
    ------
    FormatError
        No such file or name, or no camera in it.
    """
    if not isinstance(given, str | PathLike):
        return given
    if _home is None:
        raise RuntimeError("nothing loads cameras yet. Import lumigraph.")
    return _home()(given)
