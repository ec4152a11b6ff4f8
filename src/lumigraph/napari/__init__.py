"""The plugin of napari: files as layers with scale and units, and the verbs as docked widgets.

- `napari.yaml`: the plugin's manifest
- `readers`: whatever `lumigraph.open` reads, and a sample, as layers
- `shown`: nouns as layers, and layers as nouns
- `work`, `panel`: a computation in a thread, with progress and a stop button; common parts of the widgets
- `verbs`, `refocusing`, `deconvolving`: the widgets

napari and Qt are imported here alone; ``pip install lumigraph[napari]`` brings them.
"""
