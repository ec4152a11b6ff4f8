"""deepinv for tests, where it is installed."""

import pytest


def deepinv():
    """deepinv; a test that asks is skipped without it.

    Beside a PyTorch without CUDA, torchvision's library for CUDA cannot load, and its import fails for want
    of two names.
    """
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    if torch.version.cuda is None and not hasattr(torch.ops.torchvision, "nms"):
        library = torch.library.Library("torchvision", "DEF")
        for name in ("nms", "qnms"):
            library.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        torch.ops.lumigraph_keeps = library
    return pytest.importorskip("deepinv", reason="deepinv is not installed")
