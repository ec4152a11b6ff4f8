"""Modules that can be called: `lumigraph.depth(views)` beside `lumigraph.depth.epi`."""

import sys
from types import ModuleType

TYPE_CHECKING = False  # `typing` is slow to import
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


class VerbModule(ModuleType):
    """Module whose call runs its verb."""

    _verb: "Callable[..., Any]"

    def __call__(self, *things: "Any", **options: "Any") -> "Any":
        """Result of the verb."""
        return self._verb(*things, **options)


def make_callable(module: str, verb: "Callable[..., Any]") -> None:
    """Make an imported module callable: it runs the verb."""
    found = sys.modules[module]
    found.__class__ = VerbModule
    found.__dict__["_verb"] = verb
