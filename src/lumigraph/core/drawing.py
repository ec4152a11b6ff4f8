"""Registry of drawing functions: `core` imports no drawing library, `lumigraph` registers one."""

TYPE_CHECKING = False  # `typing` is slow to import, and `import lumigraph` imports this
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_home: "Callable[[], Any] | None" = None


def done_by(home: "Callable[[], Any]") -> None:
    """Register the drawing functions that `home` returns; it is called at the first drawing."""
    global _home
    _home = home


def draw(name: str, *things: "Any", **options: "Any") -> "Any":
    """The figure that the function `name` of the drawing module makes of things."""
    if _home is None:
        raise RuntimeError("nothing draws yet. Import lumigraph.")
    return getattr(_home(), name)(*things, **options)
