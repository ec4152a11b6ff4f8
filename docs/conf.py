"""The site: `make docs` builds it into site/, strictly and without a network."""

import shutil
import sys
from importlib import import_module
from importlib.metadata import version as _version
from inspect import ismodule
from io import StringIO
from pathlib import Path
from typing import Any

from docutils import nodes
from matplotlib.figure import Figure
from rich.console import Console
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

sys.path.insert(0, str(Path(__file__).parent))
import accessible

import lumigraph
from lumigraph.cli.app import VERBS
from lumigraph.cli.app import app as command_line

project = "lumigraph"
author = "The lumigraph developers"
project_copyright = author
release = version = _version("lumigraph")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",
]
html_theme = "furo"
html_title = "lumigraph"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
exclude_patterns = ["_build", "gallery/*.ipynb"]
templates_path = ["_templates"]

default_role = "code"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 1800  # s a cell, on a machine that others use too
nb_merge_streams = True
autosummary_generate = True
autosummary_ignore_module_all = False
EVERYDAY = {id(thing) for name in lumigraph.__all__ if not ismodule(thing := getattr(lumigraph, name))}


def _own(module: str) -> list[str]:
    """The public names of a module that have no page as everyday names."""
    found = import_module(module)
    return [name for name in getattr(found, "__all__", ()) if id(getattr(found, name)) not in EVERYDAY]


autosummary_context = {"own": _own}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": False}
napoleon_google_docstring = False
napoleon_use_rtype = False
suppress_warnings = [
    "config.cache",
    "mystnb.unknown_mime_type",
    "ref.python",  # everyday names stand in `lumigraph` and in their module
]


def _figures(block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Save the figures and the films (paths that end in .gif) that a block of an example has made."""
    from sphinx_gallery.scrapers import figure_rst

    source, saved = gallery.get("_saved", ("", []))
    if source != variables["src_file"]:  # things, not their `id`: that of a figure may be a later one's again
        saved = []
    gallery["_saved"] = variables["src_file"], saved
    found = []
    for thing in variables["example_globals"].values():
        film = isinstance(thing, Path) and thing.suffix == ".gif"
        if not (film or isinstance(thing, Figure)) or any(thing is one for one in saved):
            continue
        saved.append(thing)
        path = Path(next(variables["image_path_iterator"]))
        if film:
            path = path.with_suffix(".gif")
            shutil.copy(thing, path)
        else:
            thing.savefig(path, dpi=110)
        found.append(str(path))
    return figure_rst(found, gallery["src_dir"])


def _every_name_has_a_page(app: Any, error: Exception | None) -> None:
    """Fail where a public name of the package or of a module that the Python page lists has no entry."""
    if error is not None:
        return
    there = app.env.get_domain("py").objects
    modules = [name for name, entry in there.items() if entry.objtype == "module"]
    public = {name: getattr(lumigraph, name) for name in lumigraph.__all__ if name != "targets"}
    wanted = [one.__name__ if ismodule(one) else f"lumigraph.{name}" for name, one in public.items()]
    wanted += [f"{module}.{name}" for module in modules for name in _own(module)]
    if missing := [name for name in wanted if name not in there]:
        raise ExtensionError(f"no page of the site has {', '.join(sorted(missing))}.")


def setup(app: Any) -> None:
    """Sphinx calls this."""
    app.extensions["sphinx-mathjax-offline"].parallel_read_safe = True  # it copies files at the end
    app.connect("build-finished", _every_name_has_a_page)
    app.connect("build-finished", accessible.finish)
    app.add_directive("verbs", _Verbs)


class _Verbs(SphinxDirective):
    """The help of every verb, as the command line prints it."""

    def run(self) -> list[nodes.Node]:
        """Sphinx calls this."""
        return [self._section(verb.__name__) for verb in VERBS]

    def _section(self, name: str) -> nodes.section:
        printed = Console(file=StringIO(), width=82, color_system=None)
        command_line.help_print([name], console=printed)
        text = printed.file.getvalue().strip()
        inside = nodes.title(text=name), nodes.literal_block(text, text, language="text")
        return nodes.section("", *inside, ids=[f"lumigraph-{name}"])


sphinx_gallery_conf = {
    "examples_dirs": ["../examples/gallery"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"\.py$",
    "image_scrapers": (_figures,),
    "capture_repr": ("_repr_html_",),
    "within_subsection_order": "FileNameSortKey",
    "reset_modules": (),
    "abort_on_example_error": True,
    "parallel": True,  # as many as Sphinx's own processes (-j)
    "only_warn_on_example_error": False,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "min_reported_time": 0,
}
