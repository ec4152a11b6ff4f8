"""The thesis, reproduced: each module is one table or figure, and is found by being here.

A module registers one function with `lumigraph.studies.thesis.registry.experiment`. Modules whose name starts
with an underscore hold what several of them share.
"""
