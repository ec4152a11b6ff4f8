"""Alignment of a motorised bench in a closed loop.

- `setup`: file of a bench: which device moves what
- `rays`, `reading`: measures of white images in closed form, and those of one picture
- `belief`: what is known, with covariance and backlash; `moves`: the next moves by it
- `align`: the loop, `align` and `watch`; `log`: its steps in a folder; `drift`: the drift over hours
- `devices`: motors and camera behind Micro-Manager's interface; `unicore`: pymmcore-plus (extra `bench`)
- `simulated`: a bench whose true state is known
"""
