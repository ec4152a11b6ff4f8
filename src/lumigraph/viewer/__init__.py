"""The viewer: a page in the browser, served on the loopback interface or written as one file.

- `server`, `address`, `safety`, `connections`: a table of resources behind a random token, safely served
- `exhibit`, `opening`, `start`: the contents of a page, from files or raw images; its first picture
- `parts`, `encoding`, `packing`: an exhibit as a description (JSON) and arrays, as bytes or pictures
- `page`, `single_file`, `inline`, `static/`: the page as a table, as one file, in a notebook; its sources
- `pyramid`, `folder`: the page as a folder for any web server, with pictures in several steps, in tiles
- `designer`, `designer_parameters`, `designer_curves`, `designer_point`: a camera as sliders
"""

from lumigraph.viewer.address import Address, address_of
from lumigraph.viewer.designer import designer_site
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.folder import check_folder, export_folder, serve_folder
from lumigraph.viewer.inline import view_inline
from lumigraph.viewer.opening import Origin, open_exhibit
from lumigraph.viewer.page import site
from lumigraph.viewer.server import Resource, Site, serve
from lumigraph.viewer.single_file import export

__all__ = [
    "Address",
    "Exhibit",
    "Origin",
    "Resource",
    "Site",
    "address_of",
    "check_folder",
    "designer_site",
    "export",
    "export_folder",
    "open_exhibit",
    "serve",
    "serve_folder",
    "site",
    "view_inline",
]
