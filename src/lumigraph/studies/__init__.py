"""Studies of a camera that has been described: what it can resolve, and what could be better.

- `information`: Cramér-Rao bounds of points, errors of the best linear reconstruction
- `optimisation`: the best camera within ranges and stock
- `tolerance`: manufacturing tolerances, one by one and by chance
- `adaptive`: aberrations estimated from the light field itself
- `thesis`: the tables and figures of the thesis, reproduced
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submodules={"adaptive", "information", "optimisation", "thesis", "tolerance"}
)
