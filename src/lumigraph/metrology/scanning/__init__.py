"""Several raw images of one object: shifted scans and cameras side by side.

- `joint`: `joint_operator`, `scan`; `shifts`, `find_shifts`; `texture`, the statistics that it rests on
"""
