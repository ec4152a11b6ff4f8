"""Speed against plain SciPy, as ratios within one run, and other measurements: `python -m benchmarks`.

A module that `make bench` runs has `run()`, the rows of its table, and `show()`, which prints them.
"""
