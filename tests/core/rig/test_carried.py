# SPDX-License-Identifier: Apache-2.0
"""Hair below a bone that moves on the head, as a hat's does, hangs as that bone moves."""

import numpy as np
import pytest

from neuralocks_core.character import Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from neuralocks_core.rig import RigSampler, find_chains, rig_spec
from neuralocks_core.rig.carried import CarriedHair, moved_between
from neuralocks_core.rotation import from_vector
from tests.core.rig.builders import character, skin, tail
from tests.rig_models import random_rig_model

TIMES = np.linspace(0, 2, 61)
NODDING = np.outer(0.6 * np.sin(4 * TIMES), [1.0, 0.3, 0.0])


def rig(dynamic=True):
    """A head with a hat, a tail on each, and a network of random weights; the joints of head, hat and hair."""
    hat = [("hat", "head", (0, 1.7, 0))]
    who = character(hat + tail("own_hair") + tail("hat_hair", parent="hat", at=(0, 1.65, -0.15)))
    return who, random_rig_model(find_chains(who, patterns=["*_hair_1"]), rig_spec(dynamic))


def clip(skeleton: Skeleton, joint: str, vectors: np.ndarray, pivot: str) -> Clip:
    """Everything below a joint turns by rotation vectors (61, 3) about the place of another joint."""
    names = [name.rsplit("/", 1)[-1] for name in skeleton.names]
    place = skeleton.bind[names.index(pivot), :3, 3]
    move = np.tile(np.eye(4), (len(TIMES), 1, 1))
    move[:, :3, :3] = from_vector(vectors)
    move[:, :3, 3] = place - move[:, :3, :3] @ place
    joints = np.tile(skeleton.bind, (len(TIMES), 1, 1, 1))
    below = skeleton.below(names.index(joint))
    joints[:, below] = move[:, None] @ joints[:, below]
    return Clip(TIMES, joints)


@pytest.mark.parametrize("dynamic", [True, False])
def test_a_hat_carries_its_hair_as_a_head_would(dynamic):
    """The head's own tail stays as it is on a still head."""
    who, model = rig(dynamic)
    hats = np.array(["hat" in name for name in model.chains.names])
    nods, tips, still = (
        CarriedHair(model, model.chains.joints, who, clip(who.skeleton, joint, vectors, "head")).turns(TIMES)
        for joint, vectors in (("head", NODDING), ("hat", NODDING), ("hat", 0 * NODDING))
    )
    assert np.abs(tips[:, hats] - nods[:, hats]).max() < 1e-6 < 0.01 < np.ptp(nods[:, hats], axis=0).max()
    assert (tips[:, ~hats] == still[:, ~hats]).all()


def test_a_hat_that_is_shifted_without_a_turn_carries_its_hair():
    who, model = rig()
    motion = clip(who.skeleton, "hat", 0 * NODDING, "hat")
    hat = [name.rsplit("/", 1)[-1] for name in who.skeleton.names].index("hat")
    motion.joints[20:, who.skeleton.below(hat), 1, 3] += 0.05
    assert CarriedHair(model, model.chains.joints, who, motion).carriers.tolist() == [who.head, hat]


@pytest.mark.parametrize("degrees", [0, 0.2])
def test_a_hat_that_stays_on_the_head_changes_no_bit(degrees):
    """Up to the rounding of files; the head itself nods."""
    who, model = rig()
    nods, slips = (
        clip(who.skeleton, "head", NODDING, "head"),
        clip(who.skeleton, "hat", NODDING * np.radians(degrees), "hat"),
    )
    motion = Clip(TIMES, nods.joints @ np.linalg.inv(who.skeleton.bind) @ slips.joints)
    plain = model.evaluate(RigSampler(model.spec, who, motion).features(TIMES))
    carried = CarriedHair(model, model.chains.joints, who, motion)
    assert (carried.turns(TIMES) == plain).all() and carried.carriers.tolist() == [who.head]


@pytest.mark.parametrize("scale", [0.0, -1.0])
def test_a_hat_without_a_turn_leaves_its_hair_to_the_head(scale):
    """The hat is hidden by a scale of zero, or mirrored."""
    who, model = rig()
    motion = clip(who.skeleton, "hat", NODDING, "hat")
    hat = [name.rsplit("/", 1)[-1] for name in who.skeleton.names].index("hat")
    motion.joints[20:, hat, :3, :3] *= scale
    assert CarriedHair(model, model.chains.joints, who, motion).carriers.tolist() == [who.head]


def test_a_negative_strength_is_refused_as_a_bake_does():
    who, model = rig()
    carried = CarriedHair(model, model.chains.joints, who, clip(who.skeleton, "head", NODDING, "head"))
    with pytest.raises(NeuralocksError, match="strength -1.0: give a number of at least 0, 0 for the held pose"):
        carried.turns(TIMES, strength=-1.0)


@pytest.mark.parametrize("how", ["turn", "shift", "still", "bent", "hidden", "mirrored"])
def test_offsets_between_hair_joints_that_move_are_found(how):
    """Not joints that hair itself moves, a carrier above it, nor an offset that is held elsewhere than in the bind pose, or that has
    no readable turn in some frames.
    """
    at = {name: place for name, _, place in tail("hair", 4)}
    rows = [("hat", "head", (0, 1.7, 0)), ("hair_1", "hat", at["hair_1"]), ("off", "hair_1", at["hair_2"])]
    rows += [("hair_2", "off", at["hair_2"]), ("hair_3", "hair_2", at["hair_3"]), ("hair_4", "hair_3", at["hair_4"])]
    who = character(rows)
    points = np.eye(3) * 0.02 + [0, 1.5, -0.1]
    chains = find_chains(who, [skin(who, dict.fromkeys(("hair_1", "hair_2", "hair_3"), points))])
    assert chains.names == ("hair_1", "hair_2", "hair_3")
    off = [name.rsplit("/", 1)[-1] for name in who.skeleton.names].index("off")
    turned = {"bent": np.full((len(TIMES), 3), 0.3)}.get(how, 0 * NODDING if how in ("shift", "still") else NODDING)
    motion = clip(who.skeleton, "off", turned, "off")
    motion.joints[20:, who.skeleton.below(off), 1, 3] += 0.05 * (how == "shift")
    for joint in ("hat", "hair_3"):
        move = clip(who.skeleton, joint, NODDING, "head").joints @ who.inverse_bind
        motion.joints[:] = move @ motion.joints
    scales = {"hidden": 0.0, "mirrored": np.array([-1.0, 1, 1])}
    motion.joints[20:, who.skeleton.below(off), :3, :3] *= scales.get(how, 1.0)
    assert moved_between(chains, who, motion) == ([off] if how in ("turn", "shift") else [])
