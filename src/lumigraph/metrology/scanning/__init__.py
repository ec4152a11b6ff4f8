"""Several raw images of one object: shifted scans and cameras side by side.

- `joint`: `joint_operator`, `scan`; `shifts`, `find_shifts`; `texture`, the statistics that it rests on;
  `lenslet_light`, light of each lenslet
"""

from lumigraph.metrology.scanning.joint import joint_operator, scan
from lumigraph.metrology.scanning.shifts import FoundShifts, find_shifts

__all__ = ["FoundShifts", "find_shifts", "joint_operator", "scan"]
