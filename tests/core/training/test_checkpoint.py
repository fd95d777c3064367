# SPDX-License-Identifier: Apache-2.0
"""Checkpoints: NaN is never kept, and whatever a damaged one holds is one line."""

import json
import zipfile

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from neuralocks_core.errors import NeuralocksError  # noqa: E402
from neuralocks_core.training import checkpoint
from neuralocks_core.training.data import farm  # noqa: E402
from neuralocks_core.training.muon import muon  # noqa: E402

NAN = np.float32(np.nan)


def learning():
    """A network and its optimisers after one step."""
    torch.manual_seed(0)
    net = torch.nn.Linear(3, 2)
    optimisers = muon(net, 1e-3, 0.0)
    step(net, optimisers)
    return net, optimisers


def step(net, optimisers):
    net(torch.ones(1, 3)).square().sum().backward()
    for optimiser in optimisers:
        optimiser.step()


@pytest.mark.parametrize(
    "changes",
    [
        {"meta": np.frombuffer(b"[]", np.uint8)},
        {"meta": np.frombuffer(b'{"settings": []}', np.uint8)},
        {"meta": np.zeros(0, np.uint8)},
        {"module/net/weight": np.full((2, 3), NAN)},
        {"module/net/weight": np.array(["x"])},
        {"module/net/weight": np.zeros((3, 3), np.float32)},
        {"optimiser/0/x/momentum_buffer": np.zeros((2, 3), np.float32)},
        {"optimiser/0/0": np.zeros(2, np.float32)},
        {"optimiser/0/7/momentum_buffer": np.zeros((2, 3), np.float32)},
        {"optimiser/0/0/momentum_buffer": np.zeros(7, np.float32)},
        {"optimiser/0/0/momentum_buffer": np.full((2, 3), NAN)},
        {"optimiser/1/0/exp_avg": np.array(["x", "y"])},
        {"optimiser/1/0/exp_avg": np.zeros(2, np.int64)},
        {"optimiser/1/0/exp_avg": None},
        {"optimiser/1/0/step": np.ones(2, np.float32)},
        {"optimiser/1/0/step": np.array(-7, np.float32)},
        {"optimiser/1/0/exp_avg_sq": np.full(2, -1, np.float32)},
    ],
)
def test_a_damaged_checkpoint_is_one_line(tmp_path, changes):
    net, optimisers = learning()
    path = tmp_path / "c.npz"
    checkpoint.save(path, {"settings": {"a": 1}, "step": 1}, {"net": net}, optimisers)
    assert checkpoint.load(path, {"net": net}, optimisers, {"a": 1})["step"] == 1
    step(net, optimisers)
    with np.load(path) as archive:
        arrays = {**archive, **changes}
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(NeuralocksError, match=r"c.npz: this checkpoint does not fit \(") as caught:
        checkpoint.load(path, {"net": net}, optimisers, {"a": 1})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "wrong", [{"step": "x"}, {"step": 1.5}, {"step": True}, {"step": -1}, {"seconds": None}, {"seconds": "inf"},
              {"seconds": float("inf")}, {"changed": 5}, {"curve": {}}, {"options": [1]}, {"more": 1}]
)  # fmt: skip
def test_values_of_another_kind_than_were_kept_are_one_line(tmp_path, wrong):
    net, optimisers = learning()
    path, kept = tmp_path / "c.npz", {"step": 3, "seconds": 2, "changed": ["a"], "curve": [[1]], "options": {"a": 1}}
    like = {"step": 0, "seconds": 0.0, "changed": [], "curve": [], "options": {}}
    checkpoint.save(path, kept, {"net": net}, optimisers)
    assert checkpoint.load(path, {"net": net}, optimisers, like=like) == kept
    with np.load(path) as archive:
        arrays = dict(archive)
    like |= {name: 0 for name in wrong if name not in like}  # entries that are not there at all
    changed = {name: wrong.get(name, value) for name, value in kept.items()}
    np.savez(path, **{**arrays, "meta": np.frombuffer(json.dumps(changed).encode(), np.uint8)})
    with pytest.raises(NeuralocksError, match=r"c.npz: this checkpoint does not fit \(damaged"):
        checkpoint.load(path, {"net": net}, optimisers, like=like)


def test_what_is_not_finite_does_not_take_the_place_of_what_is(tmp_path):
    net, optimisers = learning()
    path = tmp_path / "c.npz"
    checkpoint.save(path, {"step": 1}, {"net": net}, optimisers)
    before = path.read_bytes()
    with pytest.raises(
        NeuralocksError, match="c.npz: NaN or infinity in its measures; train with a smaller --set rate"
    ):
        checkpoint.save(path, {"curve": [float("inf")]}, {"net": net}, optimisers)
    with torch.no_grad():
        net.weight[0, 0] = float("nan")
    with pytest.raises(NeuralocksError, match="c.npz: NaN or infinity in module/net/weight"):
        checkpoint.save(path, {"step": 2}, {"net": net}, optimisers)
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("shape", ["(10000000000000,)", "(99999999999999999999,)", "(-5,)"])
def test_an_array_that_claims_an_impossible_size_is_one_line(tmp_path, shape):
    net, path = torch.nn.Linear(3, 2), tmp_path / "checkpoint.npz"
    checkpoint.save(path, {}, {"net": net})
    with zipfile.ZipFile(path, "a") as archive:
        header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
        archive.writestr("more.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode())
    with pytest.raises(
        NeuralocksError, match=r"checkpoint.npz: this checkpoint does not fit \(damaged\); train without"
    ):
        checkpoint.load(path, {"net": net})
    with pytest.raises(NeuralocksError, match="checkpoint.npz: this simulation cannot be read; delete it"):
        farm.load(path)
