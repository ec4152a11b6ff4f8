"""One call from a raw image to pictures, depth and a page.

- `process`: `process`, which runs the steps that a raw image needs and writes a folder
- `inputs`, `napari_lf`: the raw image and what belongs to it, read once; settings of napari-LF beside it
- `recognise`: the kind of camera that took a raw image, with the reason for it
- `views`, `patches`, `volume`: the steps of cameras 1.0 and views, of cameras 2.0, and of microscopes
- `steps`: a folder that knows which of its files stand and are unchanged
- `shown`: pictures and films, as people look at them
- `notes`: the page of notes
"""

from lumigraph.processing.process import Processed, process

__all__ = ["Processed", "process"]
