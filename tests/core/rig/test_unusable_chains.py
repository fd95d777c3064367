# SPDX-License-Identifier: Apache-2.0
"""Chains of hair that cannot be used, on their rig or with a model that was made for another, are named in one line."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.anatomy.joint_names import prefixed_otherwise
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import HairChains, find_chains
from tests.core.rig.builders import character, skin, tail


@pytest.mark.parametrize(
    ("extra", "patterns", "words"),
    [
        ([], None, "no hair chains"),
        (tail("hair", 3, step=(0, 0, 0)), None, "has no length"),
        (tail("hair", 1), None, "hair joint 'hair_1' drives no vertices and has no child; skin the hair to its joints"),
        (tail("hair", 2), ["nothing*"], "no joint has such a name"),
        (
            tail("cape", 2, parent="chest"),
            ["cape*"],
            "joint 'cape_1' does not hang below the head joint 'head', but from 'chest': name that with --head chest",
        ),
        (
            tail("hair", 2),
            ["chest"],
            "joint 'chest' carries the head; name the first joints of the hair, which hang below 'head'",
        ),
        (tail("hair", 2), ["head"], "joint 'head' is the head; name the first joints of the hair"),
    ],
)
def test_bad_rigs_are_refused(extra, patterns, words):
    """One line with the joint's name and a remedy."""
    with pytest.raises(NeuralocksError, match=words):
        find_chains(character(extra), None, patterns)


def test_a_mirrored_or_unevenly_scaled_joint_is_refused():
    """Rotations cannot be written for them; a joint of another size as a whole is fine."""
    who = character(tail("hair", 3))
    plain = find_chains(who)
    for size in (0.01, 100):
        bind = who.skeleton.bind @ np.diag([size, size, size, 1])
        scaled = find_chains(Character(Skeleton(who.skeleton.names, who.skeleton.parents, bind)))
        np.testing.assert_allclose(scaled.axes, plain.axes, atol=1e-9)
    for scale, words in (((-1, 1, 1), "mirrored"), ((1, 2, 1), "unevenly scaled")):
        bind = who.skeleton.bind.copy()
        bind[-2, :3, :3] = np.diag(scale)
        with pytest.raises(NeuralocksError, match=words):
            find_chains(Character(Skeleton(who.skeleton.names, who.skeleton.parents, bind)))


def test_a_model_for_other_chains_is_refused():
    """By a missing name, and by bones of another length."""
    chains = find_chains(character(tail("hair", 3)))
    with pytest.raises(NeuralocksError, match="train a model for this rig"):
        chains.match(["head", "head/hair_1"], np.array([False, True]))
    longer = find_chains(character(tail("hair", 3, step=(0, -0.08, 0))))
    with pytest.raises(NeuralocksError, match="away from its place"):
        chains.check_same(longer)
    with pytest.raises(NeuralocksError, match="moves joint 'hair_1', which is not a hair joint here; train a model"):
        chains.check_same(find_chains(character(tail("lock", 3))))
    assert HairChains.from_json(chains.to_json()).names == chains.names


@pytest.mark.parametrize("axes", [0 * np.eye(3), 1e30 * np.eye(3), np.eye(3) + np.eye(3, k=1), np.diag([1.0, 1, -1])])
def test_a_model_whose_bind_axes_are_no_rotation_is_refused(axes):
    """Its rotations would be those of nothing."""
    told = find_chains(character(tail("hair", 3))).to_json()
    told["axes"] = [axes.tolist()] * len(told["names"])
    with pytest.raises(NeuralocksError, match="bind axes are not those of a rotation; get an undamaged model"):
        HairChains.from_json(told)


def test_joints_called_alike_are_told_apart_by_what_they_hang_from():
    """A jaw's tip is not a lock's; if nothing distinguishes them, none is taken."""
    lock = [("hair", "head", (0, 1.6, -0.1)), ("tip", "hair", (0, 1.5, -0.1)), ("end", "tip", (0, 1.4, -0.1))]
    chains = find_chains(character(lock))
    names = ["neck/head", "neck/head/jaw", "neck/head/jaw/tip", "neck/head/hair", "neck/head/hair/tip"]
    assert chains.names == ("hair", "tip")
    assert chains.match(names, np.ones(5, bool)).tolist() == [3, 4]
    for other in ("neck/head/hat/hair", "tip"):
        alike = [*(name.rpartition("/")[2] if other == "tip" else name for name in names), other]
        with pytest.raises(NeuralocksError, match=f"several joints below the head are named '{other[-4:].strip('/')}'"):
            chains.match(alike, np.ones(6, bool))


def test_a_rig_with_another_joint_called_as_a_chain_is_refused_before_it_is_trained():
    """No bake could tell which one the model moves."""
    rig = character([*tail("lock", 2), ("jaw", "head", (0, 1.5, 0.1)), ("tip", "jaw", (0, 1.5, 0.2))]).skeleton
    assert find_chains(Character(rig)).names == ("lock_1",)
    longer = character([*tail("lock", 3), ("jaw", "head", (0, 1.5, 0.1)), ("tip", "jaw", (0, 1.5, 0.2))]).skeleton
    alike = Character(replace(longer, names=[name.replace("/tip", "/lock_2") for name in longer.names]))
    assert find_chains(alike).names == ("lock_1", "lock_2"), "what it hangs from tells the second joint"
    who = Character(replace(rig, names=[name.replace("/tip", "/lock_1") for name in rig.names]))
    with pytest.raises(NeuralocksError, match="2 joints below the head are named 'lock_1', like a hair chain; rename"):
        find_chains(who)


def test_two_hair_joints_of_one_name_are_refused():
    rig = character([*tail("lock", 3), *tail("hair", 3)]).skeleton
    who = Character(replace(rig, names=[name.replace("/hair_2", "/lock_2") for name in rig.names]))
    with pytest.raises(NeuralocksError, match="two hair joints are named 'lock_2'; give each its own name"):
        find_chains(who)


def test_hair_joints_that_drive_no_skin_are_named():
    who = character(tail("hair", 3))
    with pytest.raises(NeuralocksError, match="'hair_1' drives no vertex of a mesh: bind the hair's mesh to it"):
        find_chains(who, [skin(who, {"head": np.eye(3) * 0.1 + [0, 1.6, 0]})])


def test_hair_below_another_joint_than_the_head_names_it():
    """A model that was trained with `--head` needs it again."""
    names = ["chest", "chest/neck", "chest/neck/head", "chest/neck/hairs", "chest/neck/hairs/hair_1"]
    names.append(f"{names[-1]}/hair_2")
    chains, below = find_chains(character(tail("hair", 3))), np.arange(6) == 2
    with pytest.raises(
        NeuralocksError, match="'hair_1' .*, but from 'neck': name that with --head neck, as in training"
    ):
        chains.match(names, below)
    with pytest.raises(NeuralocksError, match="there is no joint 'hair_1'"):
        chains.match(names[:5], below[:5])


@pytest.mark.parametrize(
    ("names", "there", "called"),
    [
        (["Hair1", "Hair2"], {"rig:Hair1", "rig:Hair2", "Ear"}, ("rig:Hair1", "rig:Hair2")),
        (["A_Hair1", "A_Hair2"], {"Hair1", "Hair2"}, ("Hair1", "Hair2")),
        (["A_Hair1", "A_Hair2"], {"B_Hair1", "B_Hair2", "C_Hair1"}, ("B_Hair1", "B_Hair2")),
        (["A_Hair1", "A_Hair2"], {"B_Hair1", "B_Hair2", "C_Hair1", "C_Hair2"}, None),
        (["Hair1", "Hair2"], {"Hair1", "Hair2"}, None),
        (["Hair1"], {"ChestHair1"}, None),
        (["Hair_"], {"Tail_"}, None),
    ],
)
def test_names_that_only_begin_otherwise(names, there, called):
    assert prefixed_otherwise(names, there) == called


def test_hair_that_hangs_from_the_neck_is_named_with_its_carrier():
    """The remedy named is one that works."""
    who = character(tail("ponytail", 3, parent="neck"))
    with pytest.raises(NeuralocksError, match="'ponytail_1' hangs from 'neck': name that with --head neck"):
        find_chains(who)
    neck = next(j for j, name in enumerate(who.skeleton.names) if name.endswith("/neck"))
    carried = replace(who, humanoid=replace(who.humanoid, joints={**who.humanoid.joints, "head": neck}))
    assert find_chains(carried).names == ("ponytail_1", "ponytail_2")


def test_chains_that_no_name_tells_come_before_a_tail_elsewhere():
    """A creature's tail is not hair: with `--head hips`, it would be trained as hair, and the head's chains left out."""
    rows = [*tail("tail", 4, at=(0, 1, -0.1), parent="hips"), *tail("Bone", 4)]
    who = character(rows)
    body = skin(who, dict.fromkeys(["hips", *(name for name, *_ in rows)], np.eye(3) * 0.1 + [0, 1.6, -0.1]))
    with pytest.raises(NeuralocksError, match="if 'Bone_1' is hair, name all that is to move with --chains"):
        find_chains(who, [body])
    with pytest.raises(NeuralocksError, match="name them with --chains PATTERN"):
        find_chains(character(tail("tail", 4, at=(0, 1, -0.1), parent="hips")))
