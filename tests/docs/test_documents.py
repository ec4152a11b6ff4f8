"""What the pages say is true: their programs run, their links lead somewhere, the names they give exist."""

import ast
import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.units import mm, nm, um

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING")),
    *sorted(ROOT.glob("docs/**/*.md")),
]
ERRATA = (ROOT / "docs/reference/thesis-errata.md").read_text()


def blocks(page: str, language: str) -> list[tuple[int, str]]:
    """Line number and text of each fenced block of a language."""
    text = (ROOT / page).read_text()
    found = re.finditer(rf"^```{language}\n(.*?)^```", text, re.M | re.S)
    return [(text.count("\n", 0, match.start(1)), match[1]) for match in found]


def run(page: str, number: int, code: str, names: dict) -> None:
    """Execute a block; a traceback shows the page's own line."""
    exec(compile("\n" * number + code, str(ROOT / page), "exec"), names)


@pytest.fixture(scope="module")
def from_matlab(tmp_path_factory):
    """All names that docs/how-to/from-matlab.md defines, run from top to bottom."""
    names: dict = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("from-matlab"))
        for number, code in blocks("docs/how-to/from-matlab.md", "python"):
            run("docs/how-to/from-matlab.md", number, code, names)
    return names


def test_the_toolbox_page_runs_and_names_every_function(from_matlab):
    text = (ROOT / "docs/how-to/from-matlab.md").read_text()
    toolbox = [
        "Angular",
        "AngularBL",
        "AngularBLC",
        "Propagate",
        "Makelens",
        "MakeArray",
        "randPhase",
        "LightField",
    ]
    toolbox += ["makeImage", "shear", "getMicroarrayGrid", "render20", "refocus20"]
    for function in toolbox:
        heading = rf"^`[^`\n]*\b{function}\([^`\n]*`.*\n+```python\n"
        assert re.search(heading, text, re.M) or f"`L = {function}(" in text, function


def test_the_listings_show_the_bar(from_matlab):
    """Bright where rays of geometrical optics lead, dark elsewhere; moduli added would leave a grey haze."""
    grid, image = from_matlab["grid"], from_matlab["image_2f"]
    inside = (np.abs(grid.y) < 160 * um)[:, None] & (np.abs(grid.x) < 100 * um)
    assert image[inside].sum() > 0.9 * image.sum()
    # 1.0: the bar lies behind one column of lenslets, of which each keeps 0.9 of an in-focus point.
    places = np.round(grid.y / (156.25 * um))
    behind = (np.abs(places) <= 1)[:, None] & (places == 0)
    assert from_matlab["raw_1"][behind].sum() > 0.75 * from_matlab["raw_1"].sum()
    # 2.0: an on-axis point is seen by two to three lenslets per axis.
    places = np.round(grid.y / (150 * um * (1 + 7.8 / 135.6)))
    behind = (np.abs(places) <= 2)[:, None] & (np.abs(places) <= 1)
    assert from_matlab["raw_2"][behind].sum() > 0.9 * from_matlab["raw_2"].sum()


def test_the_refocused_point_is_sharper_than_the_plain_one(from_matlab):
    plain = lg.refocus(from_matlab["L"], 1.0)
    assert lg.refocus(from_matlab["L"], from_matlab["alpha"]).max() > 1.5 * plain.max()


@pytest.fixture
def readme_names(tmp_path, monkeypatch):
    """Stand-ins for the reader's pictures, and coarser pixels."""
    camera = lg.PlenopticCamera(
        wavelength=550 * nm,
        object_distance=200 * mm,
        main_lens={"focal_length": 100 * mm},
        lenslets={"pitch": 100 * um, "focal_length": 3.6 * mm, "count": (15, 15)},
        sensor={"pixel_pitch": 6 * um},
    )
    monkeypatch.chdir(tmp_path)
    lg.save(lg.simulate(camera, lg.targets.white()), "white.png")
    lg.save(lg.simulate(camera, lg.targets.points([(0, 0, -10 * mm)])), "letters.png")
    coarse = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    coarse = coarse.replace(sensor={"pixel_pitch": 5 * um})
    monkeypatch.setattr(lg.FocusedPlenopticCamera, "from_catalogue", lambda name: coarse)
    return {}


def test_readme_runs_from_top_to_bottom(readme_names):
    for number, code in blocks("README.md", "python"):
        run("README.md", number, code, readme_names)
    assert Path("far.png").stat().st_size > 100
    assert Path("rays.png").stat().st_size > 10_000
    assert readme_names["picture"].max() > 0


def test_the_camera_file_of_readme_is_read(tmp_path):
    (block,) = blocks("README.md", "toml")
    (tmp_path / "camera.toml").write_text(block[1])
    assert lg.load_camera(tmp_path / "camera.toml").patch == pytest.approx(39.82, abs=0.01)


def test_every_public_name_and_module_is_listed():
    """The build of the site fails where a name of a listed module has no page (`docs/conf.py`)."""
    listed = set(re.findall(r"^   (?:\w+\.)?(\w+)$", (ROOT / "docs/reference/api.md").read_text(), re.M))
    assert set(lg.__all__) - listed <= {"targets", "metric"}
    packages = {path.parent.name for path in ROOT.glob("src/lumigraph/*/__init__.py")}
    inside = {"cli", "core", "demo", "describe", "napari", "processing", "report", "store"}
    assert packages - inside <= listed


def test_notebooks_come_without_results_and_are_listed():
    index = (ROOT / "docs/notebooks/index.md").read_text("utf-8")
    notebooks = sorted(ROOT.glob("docs/notebooks/*.ipynb"))
    assert len(notebooks) >= 5
    for path in notebooks:
        assert f"{{download}}`{path.name}`" in index
        found = json.loads(path.read_text("utf-8"))
        assert found["cells"][0]["source"][0].startswith("# ")
        for cell in found["cells"]:
            if cell["cell_type"] == "code":
                assert (cell["outputs"], cell["execution_count"]) == ([], None), path
                ast.parse("".join(cell["source"]))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]+)?\)", page.read_text()):
        file = page.parent / target if target else page
        assert file.exists(), f"{page.name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(), re.M)
            slugs = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
            assert anchor[1:] in slugs, f"{page.name}: {target}{anchor}"


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`(lumigraph(?:\.\w+)+)`", ERRATA))))
def test_names_in_the_errata_exist(name):
    parts, rest = name.split("."), []
    while True:
        try:
            thing = importlib.import_module(".".join(parts))
            break
        except ModuleNotFoundError:
            rest.insert(0, parts.pop())
    for attribute in rest:
        thing = getattr(thing, attribute)


@pytest.mark.parametrize("reference", sorted(set(re.findall(r"`(tests/[\w/.]+::\w+)`", ERRATA))))
def test_tests_named_in_the_errata_exist(reference):
    file, name = reference.split("::")
    functions = [
        node.name for node in ast.walk(ast.parse((ROOT / file).read_text())) if hasattr(node, "name")
    ]
    assert name in functions


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`lumigraph reproduce ([^`]+)`", ERRATA))))
def test_experiments_named_in_the_errata_exist(name):
    from lumigraph.studies.thesis import find

    (found,) = find((name,))
    assert found.id == name


def test_the_page_about_waves_images_the_hole():
    """Twice the focal length before and behind a lens of 0.1 m: the hole again, upside down and as large."""
    names: dict = {}
    for page in ("docs/explanations/waves.md", "docs/explanations/partial-coherence.md"):
        for number, code in blocks(page, "python"):
            run(page, number, code, names)
    hole = np.abs(names["hole"]) ** 2 > 0.5
    assert names["image"][hole].sum() > 0.97 * names["image"].sum()
    assert names["choice"].method in lg.METHODS
