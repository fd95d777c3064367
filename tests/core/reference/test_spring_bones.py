# SPDX-License-Identifier: Apache-2.0
"""Spring bones as VRM specifies them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from neuralocks_core.reference.spring_bones import SpringSettings, spring_bones
from neuralocks_core.rig import find_chains
from neuralocks_core.rotation import from_quaternion
from tests.core.rig.builders import character, tail


def forked():
    """A chain that forks."""
    fork = tail("hair_a", 3, at=(0.05, 1.44, -0.1), parent="hair_2")
    fork += tail("hair_b", 3, at=(-0.05, 1.44, -0.1), parent="hair_2")
    return find_chains(character([*tail("hair", 2), *fork]))


def test_spring_bones_rest_and_depend_on_the_frame_rate():
    """Still in the bind pose; after the same motion at 30 and 60 fps they are elsewhere, as specified."""
    chains = forked()
    still = spring_bones(chains, np.tile(np.eye(4), (1, 20, 1, 1)), 1 / 60)
    assert np.abs(still[..., 1:]).max() < 1e-5
    ends = []
    for rate in (30, 60):
        heads = np.tile(np.eye(4), (1, rate, 1, 1))
        heads[0, :, 0, 3] = 0.2 * np.sin(8 * np.arange(rate) / rate)
        ends.append(spring_bones(chains, heads, 1 / rate, SpringSettings())[0, -1])
    assert np.abs(ends[0] - ends[1]).max() > 1e-3


def test_a_spring_bone_goes_on_as_its_specification_says():
    """A bone that sticks out backwards and is pulled down: both frames computed by hand."""
    who = character([("hair_1", "head", (0, 1.6, 0)), ("hair_2", "hair_1", (0, 1.6, -0.3))])
    step, drag, stiffness, gravity = 0.1, 0.4, 1.0, 0.5
    pull = np.array([0, 0, -1.0]) * stiffness * step + np.array([0, -1.0, 0]) * gravity * step
    tails = [np.array([0, 0, -0.3])] * 2
    for _ in range(2):
        free = tails[-1] + (tails[-1] - tails[-2]) * (1 - drag) + pull
        tails.append(0.3 * free / np.linalg.norm(free))
    heads = np.tile(np.eye(4), (1, 2, 1, 1))
    turns = spring_bones(find_chains(who), heads, step, SpringSettings(stiffness, drag, gravity))
    found = from_quaternion(turns[0, :, 0]) @ [0, 0, -0.3]
    assert found == pytest.approx(np.array(tails[2:]), abs=1e-6)


def test_spring_bones_follow_those_above_them_in_the_same_frame():
    """The procedure of VRMC_springBone 1.0 on nodes with arbitrary bind axes, from the root to the descendants."""
    chains = find_chains(character(tail(joints=5, at=(0, 1.6, 0), step=(0.01, -0.05, -0.02))))
    step, settings = 1 / 60, SpringSettings(1.3, 0.25, 0.4)
    time, rng = step * np.arange(40), np.random.default_rng(0)
    head = Rotation.from_rotvec(np.stack([0.5 * np.sin(5 * time), 0.8 * np.sin(3 * time), 0.2 * time], axis=1))
    heads = np.tile(np.eye(4), (1, len(time), 1, 1))
    heads[0, :, :3, :3], heads[0, :, :3, 3] = head.as_matrix(), np.outer(np.sin(6 * time), [0.2, 0.1, -0.3])
    turns = from_quaternion(spring_bones(chains, heads, step, settings)[0])
    bind = [Rotation.from_rotvec(rng.normal(size=3)) for _ in range(len(chains))]
    axis = [own.inv().apply(bone) for own, bone in zip(bind, chains.bones, strict=True)]
    current = [head[0].apply(origin + bone) for origin, bone in zip(chains.origins, chains.bones, strict=True)]
    previous = current.copy()
    for frame in range(len(time)):
        parent, place, ours = head[frame], heads[0, frame, :3, 3], head[frame]
        for joint, length in enumerate(chains.lengths):
            above = bind[joint - 1] if joint else Rotation.identity()
            local = above.inv() * bind[joint]
            way = chains.origins[joint] - (chains.origins[joint - 1] if joint else 0)
            place = place + parent.apply(above.inv().apply(way))
            tip = current[joint] + (current[joint] - previous[joint]) * (1 - settings.drag)
            tip = tip + step * settings.stiffness * (parent * local).apply(axis[joint]) / length
            tip = tip + step * settings.gravity_power * np.array([0, -1, 0])
            tip = place + (tip - place) * length / np.linalg.norm(tip - place)
            previous[joint], current[joint] = current[joint], tip
            aim = (parent * local).inv().apply(tip - place)
            parent = parent * local * Rotation.align_vectors([aim], [axis[joint]])[0]
            ours = ours * Rotation.from_matrix(turns[frame, joint])
            assert ours.apply(chains.bones[joint]) == pytest.approx(parent.apply(axis[joint]), abs=1e-6)


def test_where_a_head_stands_and_which_way_it_faces_changes_nothing():
    """Gravity is along the axis about which it faces another way."""
    heads, placed, settings = np.tile(np.eye(4), (1, 12, 1, 1)), np.eye(4), SpringSettings(0.5, 0.3, 0.4)
    heads[0, :, :3, 3] = np.outer(np.sin(np.arange(12)), [0.1, 0.05, -0.1])
    placed[:3, :3], placed[:3, 3] = Rotation.from_rotvec([0, 2.0, 0]).as_matrix(), [3.0, 1.6, -5.0]
    here, there = (spring_bones(forked(), each, 1 / 30, settings) for each in (heads, placed @ heads))
    np.testing.assert_allclose(there, here, atol=1e-5)
    assert np.abs(here[..., 1:]).max() > 0.05
    np.testing.assert_allclose(np.linalg.norm(here, axis=-1), 1, atol=1e-6)


def test_each_clip_may_have_settings_of_its_own():
    heads, few = np.tile(np.eye(4), (2, 12, 1, 1)), [SpringSettings(0.3, 0.15, 0.6), SpringSettings(2.5, 0.4, 0.0)]
    heads[:, :, 0, 3] = 0.2 * np.sin(np.arange(12))
    own = SpringSettings(*np.transpose([(each.stiffness, each.drag, each.gravity_power) for each in few]))
    together = spring_bones(forked(), heads, 1 / 30, own)
    for number, each in enumerate(few):
        alone = spring_bones(forked(), heads[number : number + 1], 1 / 30, each)
        np.testing.assert_allclose(together[number], alone[0], atol=1e-6)
