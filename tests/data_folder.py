"""Where real raw images lie: the folder named by LUMIGRAPH_DATA, or `shared/data` beside the project."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("LUMIGRAPH_DATA") or Path(__file__).parents[2] / "shared" / "data")


def real(*parts: str) -> Path:
    """Path of a real data file; the test is skipped where it is absent."""
    path = DATA.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"real data is not here: set LUMIGRAPH_DATA to a folder that holds {'/'.join(parts)}")
    return path
