"""Transfer functions and kernels that were built before: building one costs more than the transforms."""

from lumigraph.core.cache import ByteCache

CACHE = ByteCache()
"""The one cache of this package: 1 GiB."""
