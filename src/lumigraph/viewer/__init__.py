"""The viewer: a page in the browser, served on the loopback interface or written as one file.

- `server`: what is served: a fixed table of resources behind a random token; knows nothing of light fields
- `address`: a private file that leads a browser to the page
- `safety`: which requests are answered, and the headers of every answer
- `exhibit`: what one page shows: views, raw image, focal stack, depth, volume
- `opening`: a file, or a raw image with its calibration, as an exhibit
- `parts`: an exhibit as a description (JSON) and arrays that are sent when they are asked for
- `encoding`: arrays as bytes: as they are, losslessly smaller, or as pictures
- `page`: the page's files, as a table to serve
- `packing`: how arrays are kept in a page that is written
- `single_file`: the same page as one file that works from disk
- `pyramid`, `folder`: the same page as a folder for any web server, with pictures in several steps, in tiles
- `designer`, `designer_parameters`, `designer_curves`, `designer_point`: a camera as sliders
"""

from lumigraph.viewer.designer import designer_site
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.folder import export_folder, serve_folder
from lumigraph.viewer.inline import view_inline
from lumigraph.viewer.opening import Origin, open_exhibit
from lumigraph.viewer.page import site
from lumigraph.viewer.server import Site, serve
from lumigraph.viewer.show import show
from lumigraph.viewer.single_file import export

__all__ = [
    "Exhibit",
    "Origin",
    "Site",
    "designer_site",
    "export",
    "export_folder",
    "open_exhibit",
    "serve",
    "serve_folder",
    "show",
    "site",
    "view_inline",
]


def __dir__() -> list[str]:
    return __all__
