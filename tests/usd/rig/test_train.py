# SPDX-License-Identifier: Apache-2.0
"""What `rig train` refuses before it reads anything: what it needs and lacks, and numbers that no training can use."""

import sys

import pytest

from neuralocks_core.errors import NeuralocksError
from usd.models.train import train
from usd.rig.train import train_rig


@pytest.mark.parametrize("package", ["torch", "onnx", "warp"])
def test_what_is_missing_is_told_before_anything_is_read(tmp_path, monkeypatch, package):
    """Not after minutes of training, when the model is written."""
    for other in {"torch", "onnx", "warp"} - {package}:
        pytest.importorskip(other, reason="the extra 'train' is not installed")
    monkeypatch.setitem(sys.modules, package, None)
    none, out = tmp_path / "none.usda", tmp_path / "m.neuralocks"
    for work in (lambda: train_rig(none, out), lambda: train(none, ["library"], [], out, {})):
        with pytest.raises(NeuralocksError, match=rf"{package} is not installed; pip install 'neuralocks\[train\]'"):
            work()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"seconds": 0.5}, "--seconds 0.5: must be a number from 1 to 86400"),
        ({"steps": 0}, "--steps 0: must be a whole number from 1"),
        ({"steps": 2.5}, "--steps 2.5: must be a whole number from 1"),
        ({"hidden": 0}, "--hidden 0: must be a whole number from 1 to 256"),
        ({"clips": 1}, "--clips 1: must be a whole number from 2 to 10000"),
        ({"material": {"bend": float("nan")}}, "--bend nan: must be a number from 1e-06 to 10000"),
        ({"dynamic": False, "clips": 8}, "have no effect on held poses; leave out --quasi-static"),
        ({"dynamic": False, "material": {"damping": 2.0}}, "have no effect on held poses"),
    ],
)
def test_numbers_that_no_training_can_use_are_refused(tmp_path, given, said):
    with pytest.raises(NeuralocksError) as caught:
        train_rig(tmp_path / "none.usda", tmp_path / "m.neuralocks", **given)
    assert said in str(caught.value)
