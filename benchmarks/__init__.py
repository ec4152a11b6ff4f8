"""Speed against plain SciPy, as ratios within one run: `python -m benchmarks` runs every module here.

Each module has `run() -> list[dict]`, the rows of its table, and prints them when it is run by itself.
"""
