"""The light-field microscope: one question, one file, one function.

- `resolution`: beads and a vesicle through one instrument, with noise, and what comes back
- `usaf`: the finest bars that are resolved at each depth
- `_bench`: the microscope, its noise, the way back
"""
