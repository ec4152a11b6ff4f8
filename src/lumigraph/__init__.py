"""Light-field cameras and microscopes: design them, simulate their raw images, process raw images."""

__version__ = "0.1.0"
