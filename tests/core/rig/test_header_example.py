# SPDX-License-Identifier: Apache-2.0
"""The worked example beside a header, whose lines engines copy: what it prints is what the network says of that nod."""

import re
import subprocess

import numpy as np
import pytest

from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import export_c
from neuralocks_core.rig.network import held_features
from neuralocks_core.rotation import from_quaternion, from_vector, quaternion_product
from tests.core.rig.builders import random_model
from tests.core.rig.c_programs import compiled


@pytest.mark.parametrize("dynamic", [False, True])
def test_the_example_prints_the_turns_of_its_nod(tmp_path, dynamic):
    """Rotations relative to the bind pose, whatever the joints' orients, on a character that stands turned aside. The history of a
    dynamic model is empty in the first frame only.
    """
    model = random_model(spec=rig_spec(dynamic))
    export_c(model, tmp_path / "hair.h")
    program = compiled(tmp_path, (tmp_path / "hair_example.c").read_text())
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    times = np.arange(0, 60, 15) / 60
    nods = from_vector(np.outer(0.6 * np.sin(2 * np.pi * times), [1, 0, 0]))
    head = from_quaternion(np.array([0.6, 0, 0.8, 0])) @ nods
    back = np.swapaxes(nods, 1, 2)
    features = held_features(model.spec, np.stack([back, back], axis=1), -head[:, 1])
    turns = model.evaluate(features)[:, 0]
    local = quaternion_product(np.array([0.8, 0, 0, 0.6]), turns.astype(float))
    told = np.array([[float(number) for number in re.findall(r"-?\d+\.\d+", line)] for line in lines])
    exact = slice(1 if dynamic else 4)
    wanted = np.hstack([times[:, None], turns, local])
    np.testing.assert_allclose(told[exact], wanted[exact], atol=1.1e-3)
    assert np.ptp(told[:, 2]) > 0.05 and all(f" {model.chains.names[0]} turns by" in line for line in lines)
    assert not dynamic or np.abs(told[1:] - wanted[1:]).max() > 0.01
