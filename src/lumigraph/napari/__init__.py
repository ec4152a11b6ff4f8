"""The plugin of napari: files as layers with scale and units, and the verbs as docked widgets.

- `napari.yaml`: what napari is told
- `readers`: whatever `lumigraph.open` reads, and a sample, as layers
- `shown`: nouns as layers, and layers as nouns
- `work`: a computation in a thread of its own, with its progress, which can be stopped
- `panel`: what the widgets share: choices of layers, a button, progress, what was found
- `verbs`, `refocusing`, `deconvolving`: the widgets

napari and Qt are imported here alone; ``pip install lumigraph[napari]`` brings them.
"""
