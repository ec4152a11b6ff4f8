"""Data sheets of plenoptic cameras.

- `measure`: `datasheet`; `sheet`, its entries; `planes`, `steady`, one chart's quantities
- `stability`: drift over days, from dated white images
- `charts`, `exposures`, `lights`: the pictures; `simulated`, what a camera file promises
"""
