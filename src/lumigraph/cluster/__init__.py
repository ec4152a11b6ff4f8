"""Many items through one piece of work, on one machine or many: `batch` and its ledger.

- `run`: `batch`, `status`
- `estimate`: what the rest of a job needs
- `task`: what a worker does for one frame
- `pool`: worker processes of this machine
- `scheduler`: workers of a dask cluster
- `slurm`: a job array
- `ledger`: what is done, on the disk; `entry`: what is noted of a frame
- `inputs`: files that a job reads, as they were when it began
"""

from lumigraph.cluster import inputs, slurm
from lumigraph.cluster.estimate import Estimate
from lumigraph.cluster.run import Cluster, Local, Report, batch, page, rows, status
from lumigraph.cluster.scheduler import Dask
from lumigraph.cluster.task import Values

__all__ = [
    "Cluster",
    "Dask",
    "Estimate",
    "Local",
    "Report",
    "Values",
    "batch",
    "inputs",
    "page",
    "rows",
    "slurm",
    "status",
]


def __dir__() -> list[str]:
    return __all__
