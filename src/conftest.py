"""Modules whose doctests are collected are imported as any program imports them.

In its importlib mode, pytest executes a module that nobody has imported yet a second time, after its package
has imported it: classes are there twice then, and a test that patches one of them patches the other one.
"""

import importlib
from pathlib import Path


def pytest_collect_file(file_path: Path) -> None:
    """Import a module under its own name before pytest looks for it."""
    if file_path.suffix == ".py" and file_path.name not in ("conftest.py", "__main__.py"):
        parts = file_path.relative_to(Path(__file__).parent).with_suffix("").parts
        importlib.import_module(".".join(parts).removesuffix(".__init__"))
