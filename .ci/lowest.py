"""Prints the lowest versions that pyproject.toml allows, one `name==version` a line, for pip."""

import re
import sys
import tomllib
from pathlib import Path

ELSEWHERE = {
    "gpu": "some GB; the tests of arrays run on another version",
    "napari": ".ci/napari runs on the versions of .ci/napari.txt",
    "optiland": ".ci/optiland runs on the versions of .ci/optiland.txt",
    "deepinv": "needs PyTorch; the tests of operators run on other versions where it is there",
    "scenes": "the tests of rendered scenes run on the version of .ci/run",
    "bench": "pymmcore-plus asks for newer versions of others; its tests run on that of .ci/oracles.txt",
    "docs": "tools of the pages, pinned by docs/requirements.lock",
    "dev": "tools of the tests, pinned by requirements-dev.lock, but for those that run here",
}
"""Extras whose lowest versions are not installed, and why."""

TOOLS = ("array-api-strict", "hypothesis", "httpx", "pytest", "pytest-timeout")
"""Of the extra "dev", those that the tests need."""


def lowest(requirement: str) -> str:
    """The lowest version that a requirement allows.

    >>> lowest("pyright[nodejs]>=1.1.400"), lowest("optiland>=0.6.3,<0.7")
    ('pyright[nodejs]==1.1.400', 'optiland==0.6.3')
    """
    found = re.fullmatch(r"([\w.\[\]-]+)>=([\w.]+)(,.*)?", requirement)
    if found is None:
        raise SystemExit(f"pyproject.toml has {requirement!r}, of which the lowest version is not known.")
    return f"{found[1]}=={found[2]}"


def main() -> None:
    """Print them; what is left out is said on standard error."""
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    tools = [one for one in extras["dev"] if one.partition(">=")[0] in TOOLS]
    extra = [one for name in extras if name not in ELSEWHERE for one in extras[name]]
    print("\n".join(dict.fromkeys(map(lowest, [*project["dependencies"], *extra, *tools]))))
    for name, why in ELSEWHERE.items():
        print(f"not installed: {name} ({why})", file=sys.stderr)


if __name__ == "__main__":
    main()
