"""Light-field cameras and microscopes: design them, simulate their raw images, process raw images.

The everyday names, listed in `__init__.pyi`; each is imported when it is first used, so that
``import lumigraph`` stays quick. Nothing inside the package imports this module.

>>> import lumigraph as lg
>>> camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
>>> round(camera.lenslet_distance * 1e3, 3)
7.8
"""

import lazy_loader

from lumigraph.core import drawing

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

drawing.done_by(lambda: __getattr__("plots"))
