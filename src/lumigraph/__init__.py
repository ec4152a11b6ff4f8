"""Light-field cameras and microscopes: design them, simulate their raw images, process raw images.

The everyday names, listed in `__init__.pyi`; each is imported when it is first used, so that
``import lumigraph`` stays quick. Nothing inside the package imports this module.

>>> import lumigraph as lg
>>> camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
>>> round(camera.lenslet_distance * 1e3, 3)
7.8
"""

from lumigraph.core import upper_floors

__version__ = "0.1.0"

TYPE_CHECKING = False  # `typing` takes ten times as long as all of this
if TYPE_CHECKING:
    from typing import Any


def __getattr__(name: str) -> "Any":
    """Read `__init__.pyi` at the first name: until then nothing slow is imported, and Ctrl-C is quiet."""
    import lazy_loader

    names = ("__getattr__", "__dir__", "__all__")
    found: dict[str, Any] = dict(zip(names, lazy_loader.attach_stub(__name__, __file__), strict=True))
    globals().update(found)
    return found[name] if name in found else found["__getattr__"](name)


def __dir__() -> list[str]:
    return __getattr__("__all__")


def _describe() -> "Any":
    from importlib import import_module

    return import_module("lumigraph.describe")


upper_floors.register(plots=lambda: __getattr__("plots"), describe=_describe)
