"""Registry of functions of upper floors that nouns call: `core` imports none of them, `lumigraph` does."""

TYPE_CHECKING = False  # `typing` is slow to import, and `import lumigraph` imports this
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_homes: "dict[str, Callable[[], Any]]" = {}


def register(**homes: "Callable[[], Any]") -> None:
    """Register functions that return the modules "plots" and "describe"; called when first needed."""
    _homes.update(homes)


def draw(name: str, *things: "Any", **options: "Any") -> "Any":
    """The figure that the function `name` of `lumigraph.plots` makes of things."""
    return _function("plots", name)(*things, **options)


def describe(name: str, instrument: "Any") -> "Any":
    """The table that the function `name` of `lumigraph.describe` makes of an instrument."""
    return _function("describe", name)(instrument)


def _function(home: str, name: str) -> "Any":
    if home not in _homes:
        raise RuntimeError(f"nothing is registered for {home}. Import lumigraph.")
    return getattr(_homes[home](), name)
