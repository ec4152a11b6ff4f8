"""Images of points before a camera: light in the main lens → in the lenslet plane → behind the lenslets.

One chain of pure steps. Sampling is decided once from plain numbers (`SampledCamera`); all else are arrays
computed from a camera's numbers, with nothing written in place, by the functions of an array library.

- `array_libraries` the functions that the chain calls: NumPy's, autograd's, PyTorch's
- `main_lens` the wave in the main lens, whose stop is sampled with smooth edges
- `square` light behind square lenslets that are alike
- `sampled_camera` which samples a camera before points takes
"""
