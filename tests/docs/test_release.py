"""Version, requirements and references of the release agree wherever they are stated."""

import re
import tomllib
from pathlib import Path

import lumigraph

ROOT = Path(__file__).parents[2]


def test_the_version_is_the_same_everywhere():
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    recipe = (ROOT / "recipe/recipe.yaml").read_text("utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.M) == [lumigraph.__version__]
    assert re.findall(r'^  version: "(.+)"$', recipe, re.M) == [lumigraph.__version__]
    assert f"## {lumigraph.__version__}\n" in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_the_conda_recipe_asks_for_what_the_wheel_asks_for():
    """conda-forge calls matplotlib without its windows matplotlib-base."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    run = (ROOT / "recipe/recipe.yaml").read_text("utf-8").split("  run:\n")[1].split("\n\n")[0]
    asked = {line.strip("- ").replace(" ", "") for line in run.splitlines() if "python " not in line}
    assert {line.replace("matplotlib-base", "matplotlib") for line in asked} == set(project["dependencies"])
    (least,) = re.findall(r'^  python_min: "(.+)"$', (ROOT / "recipe/recipe.yaml").read_text("utf-8"), re.M)
    assert project["requires-python"] == f">={least}"


def test_every_reference_of_the_paper_is_used_and_every_citation_is_there():
    paper = (ROOT / "paper/paper.md").read_text("utf-8")
    cited = set(re.findall(r"@(\w+\d{4})", paper))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper/paper.bib").read_text("utf-8"), re.M))
    for picture in re.findall(r"\]\((\.\./[^)]+\.png)\)", paper):
        assert (ROOT / "paper" / picture).is_file()
    assert 750 < len(paper.split()) < 1250


def test_release_notes_are_read_at_one_sitting():
    assert len((ROOT / "CHANGELOG.md").read_text("utf-8").splitlines()) <= 70
