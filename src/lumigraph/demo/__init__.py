"""The demonstration: two cameras, a scene with three depths, and everything that lumigraph does with them.

- `showcase`: `run`, which simulates, calibrates, decodes or renders, refocuses and writes a report
- `plenoptic.toml`, `focused_plenoptic.toml`: the two bundled cameras
"""

from lumigraph.demo.showcase import run

__all__ = ["run"]


def __dir__() -> list[str]:
    return __all__
