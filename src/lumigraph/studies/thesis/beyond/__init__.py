"""Experiments beyond the thesis.

- `deconvolution`: what deconvolution makes of a camera 2.0's raw image, and what physics forbids
"""
