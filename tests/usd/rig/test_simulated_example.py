# SPDX-License-Identifier: Apache-2.0
"""The simulation of the shipped example's chains: it begins at rest, and looks only at contacts that may be near."""

import numpy as np
import pytest

pytest.importorskip("torch")

from neuralocks_core.animation.random_motion import random_clip, scripted_clip
from neuralocks_core.body.surface_samples import SurfaceSamples
from neuralocks_core.motion import Clip
from neuralocks_core.reference import chain_contact
from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.rig.motion import RATE, simulate_motions
from neuralocks_core.training.rig.report import hair_points, no_turns
from tests.usd.rig_shots import EXAMPLE
from usd.rig.stage import read_rigged_hair


@pytest.fixture(scope="module")
def rig():
    return read_rigged_hair(EXAMPLE / "character.usda").rig


@pytest.mark.parametrize("kind", ["nod", "tilt"])
def test_hair_begins_at_rest(rig, kind):
    """With the head held where it leans farthest, nothing moves afterwards."""
    clip = scripted_clip(rig.character, kind, 4.0)
    leant = clip.joints[np.argmin(clip.joints[:, rig.character.head, 1, 1])]
    held = Clip(np.array([0.0, 1.0]), np.stack([leant, leant]))
    points = hair_points(rig, simulate_motions(rig, RigMaterial(), rig_spec(), [held])[1])[0]
    hung = points[0] - hair_points(rig, no_turns(rig))
    moved = points[-1] - points[0]
    assert np.square(hung).sum(axis=1).mean() ** 0.5 > 0.02 and np.square(moved).sum(axis=1).mean() ** 0.5 < 1e-3


def test_only_contacts_that_may_be_near_are_looked_at(rig, monkeypatch):
    """Which changes nothing, also where hair is thrown about."""
    clips = [random_clip(rig.character, np.random.default_rng(2), 1.0, rate=RATE, wild=1.0)]
    looked, planes = [], SurfaceSamples.planes
    monkeypatch.setattr(SurfaceSamples, "planes", lambda *args: looked.append(len(args[1])) or planes(*args))
    few = simulate_motions(rig, RigMaterial(), rig_spec(), clips)[1]
    some = sum(looked)
    looked.clear()
    monkeypatch.setattr(chain_contact, "ROOM", np.inf)
    every = simulate_motions(rig, RigMaterial(), rig_spec(), clips)[1]
    np.testing.assert_array_equal(few, every)
    assert some < 0.6 * sum(looked)
