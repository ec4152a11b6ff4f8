"""Light-field cameras and microscopes: design them, simulate their raw images, process raw images.

The everyday names, listed in `__init__.pyi`; each is imported when it is first used, so that
``import lumigraph`` stays quick. Nothing inside the package imports this module.

>>> import lumigraph as lg
>>> camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
>>> round(camera.lenslet_distance * 1e3, 3)
7.8
"""

from lumigraph.core import upper_floors

__version__ = "0.2.0"

TYPE_CHECKING = False  # `typing` takes ten times as long as all of this
if TYPE_CHECKING:
    from typing import Any


_RENAMED = {"view": "sub_aperture", "metric": "metrology"}
"""Names of earlier versions."""

_found: "dict[str, Any]" = {}


def __getattr__(name: str) -> "Any":
    """Read `__init__.pyi` at the first name: until then nothing slow is imported, and Ctrl-C is quiet."""
    if name in _RENAMED:
        raise AttributeError(f"lumigraph.{name} is now called lumigraph.{_RENAMED[name]}.")
    if not _found:
        import lazy_loader

        names = ("__getattr__", "__dir__", "__all__")
        _found.update(zip(names, lazy_loader.attach_stub(__name__, __file__), strict=True))
    return _found[name] if name in _found else _found["__getattr__"](name)


def __dir__() -> list[str]:
    return __getattr__("__all__")


def _imported(module: str) -> "Any":
    from importlib import import_module

    return import_module(f"lumigraph.{module}")


upper_floors.register(
    plots=lambda: __getattr__("plots"),
    describe=lambda: _imported("describe"),
    cameras=lambda: _imported("instruments"),
)
