"""A batch's store while it grows, as other programs read it."""

import numpy as np
import pytest
import zarr

import lumigraph as lg
from cluster_jobs import Here
from lumigraph import cluster


def volume(item):
    """Of one value each."""
    data = np.full((2, 3, 4), 1.0 + item, np.float32)
    return lg.Volume(data, lg.Grid((3, 4), 2e-6, (1e-6, 0.0)), (-1e-6, 1e-6))


@pytest.fixture
def growing(tmp_path):
    """The second of three parts is there."""
    found = cluster.batch(volume, list(range(6)), tmp_path / "out.ome.zarr", workers=Here(), part=(2, 3))
    assert (found.done, found.count) == (2, 6)
    return zarr.open_group(tmp_path / "out.ome.zarr", mode="r")


def test_its_metadata_are_valid_for_ome_zarr_models(growing):
    models = pytest.importorskip("ome_zarr_models.v05", reason="ome-zarr-models is not installed: .ci/napari")
    image = models.Image.from_zarr(growing)
    (scales,) = image.ome_attributes.multiscales
    assert [(axis.name, axis.unit) for axis in scales.axes] == [
        ("t", None), ("z", "micrometer"), ("y", "micrometer"), ("x", "micrometer")
    ]  # fmt: skip
    assert [dataset.path for dataset in scales.datasets] == ["0"]
    scale, moved = scales.datasets[0].coordinateTransformations
    assert scale.scale == pytest.approx([1, 2, 2, 2])
    assert moved.translation == pytest.approx([0, -1, -1, -4])


def test_napari_shows_frames_that_are_there_and_others_when_they_come(growing, viewer):
    array = pytest.importorskip("dask.array", reason="dask is not installed: .ci/napari")
    layer = viewer.add_image(array.from_zarr(growing["0"]), contrast_limits=(0, 6))
    assert layer.ndim == 4
    viewer.dims.set_point(0, 0)
    assert np.isnan(layer._slice.image.raw).all()
    viewer.dims.set_point(0, 3)
    assert (layer._slice.image.raw == 4).all()
    cluster.batch(volume, list(range(6)), growing.store.root, workers=Here())
    viewer.dims.set_point(0, 5)  # napari keeps what it has read of frame 0
    assert (layer._slice.image.raw == 6).all()
