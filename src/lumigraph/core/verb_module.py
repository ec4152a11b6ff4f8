"""Modules that can be called: `lumigraph.depth(views)` beside `lumigraph.depth.epi`.

The verb may live on a higher floor, so `lumigraph` registers it, as it does what draws (`drawing`).
"""

import sys
from types import ModuleType

TYPE_CHECKING = False  # `typing` is slow to import, and `import lumigraph` imports this
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_homes: "dict[str, Callable[[], Callable[..., Any]]]" = {}


class VerbModule(ModuleType):
    """Module whose call runs the verb that is registered for it."""

    def __call__(self, *things: "Any", **options: "Any") -> "Any":
        """Result of the verb."""
        return _homes[self.__name__]()(*things, **options)


def called_by(module: str, home: "Callable[[], Callable[..., Any]]") -> None:
    """Register the verb of a module; `home` gives it at the first call."""
    _homes[module] = home


def make_callable(module: str) -> None:
    """Make an imported module callable."""
    sys.modules[module].__class__ = VerbModule
