# SPDX-License-Identifier: Apache-2.0
"""What is told of joints that may be hair, and that a bake does not move."""

import pytest
from pxr import Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.notes import chain_notes, rigged_notes
from usd.rig.stage import read_rigged_hair

from ..rig_shots import model_for


def _named(*joints):
    """A change that gives the six joints other paths; those with skin are the third to the fifth."""

    def change(stage):
        for path in ("/Who/Rig", "/Who/Motion"):
            stage.GetPrimAtPath(path).GetAttribute("joints").Set(joints)

    return change


@pytest.mark.parametrize(
    ("above", "lock", "told"),
    [
        (
            "hips/neck",
            "pony",
            "'pony' hangs from 'neck' and is not moved; to move all, train and bake with --head neck",
        ),
        ("hips", "hair_back", "'hair_back' hangs from 'hips' and is not moved; parent it to the head in the rig"),
        ("hips", "tail_0", None),
        ("hips/neck", "scarf_fringe", None),
    ],
)
def test_hair_that_hangs_beside_the_head_is_told(edited, tmp_path, above, lock, told):
    """With hair on the head, a bake succeeds although it leaves out the rest."""
    head = "hips/neck/head"
    shot = edited(_named("hips", "hips/neck", head, f"{head}/hair_0", f"{above}/{lock}", f"{head}/hair_0/end"))
    hair = read_rigged_hair(shot)
    baked = bake_rig(shot, tmp_path / "out.usda", model_for(hair)).notes
    for notes in (baked, rigged_notes(hair.stage_rig), inspect(shot)["spoils"]):
        assert [note for note in notes if " not moved; " in note] == ([f"/Who/Rig: {told}"] if told else [])


def test_of_several_joints_beside_the_head_one_is_named(edited):
    shot = edited(_named("hips", "hips/head", "hips/pony", "hips/pony_2", "hips/head/hair_0", "hips/head/hair_0/end"))
    (note,) = [note for note in rigged_notes(read_rigged_hair(shot).stage_rig) if "not moved" in note]
    assert note == "/Who/Rig: 'pony' and 1 more hang from 'hips' and are not moved; parent them to the head in the rig"


def test_hair_below_a_copy_of_the_head_is_moved(edited):
    """As in a control rig, where the copy is often named like a head, too: it is no second head."""

    def change(stage):
        copy = "hips/ORG_head"
        _named("hips", "hips/head", copy, f"{copy}/hair_0", f"{copy}/hair_0/hair_1", f"{copy}/hair_0/hair_1/end")(stage)
        places = stage.GetPrimAtPath("/Who/Rig").GetAttribute("bindTransforms")
        hips, head, _, *hair = places.Get()
        places.Set([hips, head, head, *hair])
        UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar().Set([1] * 3 + [3] * 3 + [4] * 3)

    hair = read_rigged_hair(edited(change))
    assert hair.stage_rig.character.skeleton.names[hair.stage_rig.character.head] == "hips/head"
    assert hair.rig.chains.names == ("hair_0", "hair_1")
    assert not [note for note in rigged_notes(hair.stage_rig) if "not moved" in note]


def test_no_joint_is_told_because_of_the_rigs_name(edited):
    """`Pony` means hair wherever a joint hangs."""
    joints = (
        "hips",
        "hips/neck",
        "hips/neck/head",
        "hips/neck/head/hair_0",
        "hips/neck/coat",
        "hips/neck/head/hair_0/end",
    )
    shot = edited(_named(*("/".join(f"Pony_{part}" for part in joint.split("/")) for joint in joints)))
    hair = read_rigged_hair(shot)
    assert hair.rig.chains.names == ("Pony_hair_0",)
    assert not any(" not moved; " in note for note in rigged_notes(hair.stage_rig))


def test_a_joint_beside_the_head_that_moves_nothing_is_not_told(edited):
    head = "hips/neck/head"
    shot = edited(_named("hips", "hips/neck", head, f"{head}/hair_0", f"{head}/hair_0/end", "hips/neck/pony"))
    assert not any(" not moved; " in note for note in rigged_notes(read_rigged_hair(shot).stage_rig))


@pytest.mark.parametrize(
    ("names", "drives", "told"),
    [
        (
            ["cable"],
            [4, 6, 7, 8, 7, 8],
            "'cable_0' is not moved; if it is hair, name all that is to move with --chains",
        ),
        (
            ["cable", "rope"],
            [6, 7, 8, 9, 10, 11],
            "'cable_0' and 1 more are not moved; if they are hair, name all that",
        ),
        (["ear"], [4, 6, 7, 8, 7, 8], None),
    ],
)
def test_chains_of_other_names_beside_those_found_are_told(edited, names, drives, told):
    """In a mesh that the body also drives, only names show which joints are hair; joints in rows of three may be."""
    head = "hips/head"

    def change(stage):
        rig = stage.GetPrimAtPath("/Who/Rig")
        for attribute in (rig.GetAttribute("bindTransforms"), rig.GetAttribute("restTransforms")):
            attribute.Set(Vt.Matrix4dArray([*attribute.Get(), *list(attribute.Get())[2:5] * len(names)]))
        more = [f"{n}_0/{n}_1/{n}_2".split("/")[: k + 1] for n in names for k in range(3)]
        rig.GetAttribute("joints").Set([*rig.GetAttribute("joints").Get(), *("/".join([head, *way]) for way in more)])
        UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar().Set([0, 2, 3, *drives])

    shot = edited(change)
    hair = read_rigged_hair(shot)
    found = chain_notes(hair, None)
    assert [note.startswith(f"/Who/Rig: {told}") for note in found] == [True] * bool(told)
    assert chain_notes(hair, ["hair_0"]) == []
    assert [note for note in inspect(shot)["spoils"] if " not moved; " in note] == found


def with_strands(shot):
    """The stage of a shot, with a strand beside the mesh hair."""
    stage = Usd.Stage.Open(str(shot))
    curves = UsdGeom.BasisCurves.Define(stage, "/Who/Strands")
    curves.CreatePointsAttr([(0, 1.6, 0), (0, 1.7, 0)])
    curves.CreateCurveVertexCountsAttr([2])
    stage.Save()
    return stage


@pytest.mark.parametrize(
    ("name", "drives", "told"),
    [
        ("cable", [0, 2, 3, 4, 2, 3, 4, 0, 0], "the body drives that mesh, too; if it is hair"),
        ("cable", [2, 2, 2, 1, 1, 1, 1, 1, 1], None),  # with its own mesh it is found
        ("ear", [0, 2, 3, 4, 2, 3, 4, 0, 0], None),
    ],
)
def test_chains_of_other_names_are_told_where_none_is_found(edited, name, drives, told):
    """With names for choosing them, and if the stage has hair of another kind, only if they are like hair."""
    head = "hips/head"
    tail = [f"{head}/{name}_0", f"{head}/{name}_0/{name}_1", f"{head}/{name}_0/{name}_1/{name}_2"]

    def change(stage):
        _named("hips", head, *tail, f"{tail[-1]}/end")(stage)
        UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar().Set(drives)

    shot = edited(change)

    def notes():
        return [note for note in inspect(shot)["spoils"] if "below the head, but" in note]

    assert len(notes()) == bool(told)
    if not told:
        return
    (note,) = notes()
    assert note.startswith(f"/Who/Rig: '{name}_0' drives skin below the head, but no name says hair and {told}")
    assert len(read_rigged_hair(shot, chains=[note.rpartition("--chains ")[2]]).rig.chains) == 3
    stage = with_strands(shot)
    assert notes() == [note]
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar().Set([0, 1, 2, 3, 2, 3, 0, 0, 0])
    stage.Save()
    assert notes() == []


def test_a_beard_is_told_where_no_hair_is_found(edited):
    """In a stage with hair of another kind, it may be a scarf."""
    head = "hips/head"
    beard = [f"{head}/beard_0", f"{head}/beard_0/beard_1", f"{head}/beard_0/beard_1/beard_2"]

    def change(stage):
        _named("hips", head, *beard, f"{beard[-1]}/end")(stage)
        UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar().Set([2, 3, 4] * 3)

    shot = edited(change)

    def notes():
        return [note for note in inspect(shot)["spoils"] if "below the head, but" in note]

    (note,) = notes()
    assert "'beard_0' drives" in note and "it is named like what a face has or wears; if it is hair" in note
    assert len(read_rigged_hair(shot, chains=[note.rpartition("--chains ")[2]]).rig.chains) == 3
    with_strands(shot)
    assert notes() == []


def test_a_single_joint_that_drives_a_mesh_of_its_own_is_told(edited):
    def change(stage):
        head = "hips/head"
        _named("hips", head, f"{head}/lobe", f"{head}/b1", f"{head}/b2", f"{head}/b3")(stage)

    (note,) = [note for note in inspect(edited(change))["spoils"] if "below the head, but" in note]
    assert note.startswith(
        "/Who/Rig: 'lobe' and 2 more drive skin below the head, but no name says hair and it is a single"
    )


@pytest.mark.parametrize("locks", [["pony"], ["hair_0", "pony"]])
def test_a_model_of_hair_on_the_neck_needs_the_head_that_it_was_trained_with(edited, tmp_path, locks):
    shot = edited(_named("neck", "neck/head", "neck/head/hair_0", "neck/head/hair_0/end", "neck/pony", "neck/pony/end"))
    hair = read_rigged_hair(shot, head="neck", chains=locks)
    assert len(hair.rig.chains) == len(locks)
    with pytest.raises(
        NeuralocksError, match="'pony' does not hang .*, but from 'neck': name that with --head neck, as"
    ):
        bake_rig(shot, tmp_path / "out.usda", model_for(hair))


@pytest.mark.parametrize(
    ("joints", "first", "told"),
    [
        (
            ["neck", "neck/head", "neck/head/hair_0", "neck/head/hair_0/end", "neck/pony", "neck/pony/end"],
            {"head": "neck", "chains": ["pony"]},
            "'pony' hangs from 'neck' and is not moved",
        ),
        (
            ["head_1", "head_1/hair_0", "head_1/hair_0/end", "head_2", "head_2/curl", "head_2/curl/end"],
            {"head": "head_2"},
            "'curl' hangs from 'head_2', not from 'head_1', so it is not moved",
        ),
    ],
)
def test_hair_that_an_earlier_bake_moves_is_not_called_unmoved(edited, tmp_path, joints, first, told):
    """Each head's hair needs a model and a bake of its own, one over the other."""

    def change(stage):
        _named(*joints)(stage)
        rotations = stage.GetPrimAtPath("/Who/Motion").GetAttribute("rotations")
        for code in rotations.GetTimeSamples():  # of any head
            rotations.Set([rotations.Get(code)[1]] * len(joints), code)

    shot, one, two = edited(change), tmp_path / "one.usda", tmp_path / "two.usda"
    head = next(joint for joint in joints if joint.endswith("/hair_0")).split("/")[-2]
    model = model_for(read_rigged_hair(shot, head=head, chains=["hair_0"]))
    unmoved = [note for note in bake_rig(shot, two, model, head=head).notes if "not moved" in note]
    assert len(unmoved) == 1 and told in unmoved[0]
    bake_rig(shot, one, model_for(read_rigged_hair(shot, **first)), head=first["head"])
    baked = bake_rig(one, two, model, head=head).notes
    for notes in (baked, rigged_notes(read_rigged_hair(two, head=head, chains=["hair_0"]).stage_rig)):
        assert not any("not moved" in note for note in notes)
