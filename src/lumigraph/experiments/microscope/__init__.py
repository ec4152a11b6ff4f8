"""The light-field microscope: one question, one file, one function.

- `resolution`: beads, bars and a vesicle through one instrument, with noise, and what comes back
"""
