"""Linear maps as operators of SciPy, PyLops and deepinv: their own adjoint tests, and their solvers."""

import numpy as np
import pytest

import lumigraph as lg
from with_deepinv import deepinv

MICROSCOPE = lg.load_camera("lfm-worm").replace(lenslets={"count": (5, 5)})
OPERATOR = MICROSCOPE.operator([-5e-6, 5e-6], 3)
RNG = np.random.default_rng(7)
X, Y = RNG.random(OPERATOR.shape[1]), RNG.random(OPERATOR.shape[0])
MISMATCH = 1e-6
"""Of <Ax, y> and <x, A'y> over |Ax| |y|: sums of single precision kernels in double."""


def test_scipy_takes_an_operator_and_solves_with_it():
    from scipy.sparse.linalg import lsqr

    flat = OPERATOR.to_scipy(np.float64)
    seen = flat.matvec(X.ravel())
    np.testing.assert_allclose(seen, OPERATOR.forward(X).ravel())
    there, back = seen @ Y.ravel(), X.ravel() @ flat.rmatvec(Y.ravel())
    assert abs(there - back) <= MISMATCH * np.linalg.norm(seen) * np.linalg.norm(Y)
    found = lsqr(flat, seen, iter_lim=20)[0]
    assert np.linalg.norm(flat.matvec(found) - seen) < 0.05 * np.linalg.norm(seen)


def test_pylops_own_dot_test_passes():
    pylops = pytest.importorskip("pylops", reason="PyLops is not installed")
    flat = OPERATOR.to_pylops(np.float64)
    assert (flat.dims, flat.dimsd) == (OPERATOR.shape[1], OPERATOR.shape[0])
    pylops.utils.dottest(flat, *flat.shape, rtol=MISMATCH, raiseerror=True)
    np.testing.assert_allclose(flat @ X, OPERATOR.forward(X))


def test_deepinv_takes_an_operator_and_its_adjoint_is_exact():
    deepinv()
    import torch

    seen = lg.torch.physics(OPERATOR)
    x, y = torch.as_tensor(X)[None, None], torch.as_tensor(Y)[None, None]
    there, back = float((seen.A(x) * y).sum()), float((x * seen.A_adjoint(y)).sum())
    assert abs(there - back) <= MISMATCH * float(seen.A(x).norm() * y.norm())
    single = x.float()
    assert abs(float(seen.adjointness_test(single))) <= MISMATCH * float(seen.A(single).norm()) ** 2
    assert seen.A(single).dtype == torch.float32


@pytest.mark.parametrize(("module", "call"), [("pylops", "to_pylops"), ("deepinv", "physics")])
def test_what_is_not_installed_is_said(module, call, monkeypatch):
    import sys

    pytest.importorskip("torch", reason="PyTorch is not installed")
    assert lg.torch.physics  # imported while deepinv is there
    for name in (module, f"{module}.physics"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(lg.LumigraphError, match=r"which is not installed\. Run: pip install"):
        OPERATOR.to_pylops() if call == "to_pylops" else lg.torch.physics(OPERATOR)


def test_a_torch_operator_has_exact_slopes_twice_and_refuses_other_shapes():
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    model = lg.torch.Operator(OPERATOR)
    x = torch.as_tensor(X)[None].requires_grad_()
    (slope,) = torch.autograd.grad((model(x) ** 2).sum() / 2, x, create_graph=True)
    np.testing.assert_allclose(slope[0].detach(), OPERATOR.adjoint(OPERATOR.forward(X)), rtol=1e-9)
    (curve,) = torch.autograd.grad((slope**2).sum() / 2, x)  # (A'A)² x
    again = OPERATOR.adjoint(OPERATOR.forward(slope[0].detach().numpy()))
    np.testing.assert_allclose(curve[0], again, rtol=1e-6)
    with pytest.raises(lg.GeometryError, match="must end in"):
        model(torch.zeros(3, 3))
