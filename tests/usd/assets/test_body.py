# SPDX-License-Identifier: Apache-2.0
"""The body is a standard UsdSkel character, and its animation comes back as written."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel, UsdValidation

from neuralocks_core.animation.random_motion import random_clip
from neuralocks_core.body.statistical_body import DEFAULT_PHENOTYPE, SHAPES, StatisticalBody, statistical_body
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.measures import body_measures, measures_read
from neuralocks_core.skinned_body import Body
from usd.assets.animation import write_animation
from usd.assets.body import SKELETON, write_body
from usd.shot.stage import read_rigs, read_shot

SHOT = Path(__file__).resolve().parents[3] / "examples" / "shot"


def findings(path):
    registry = UsdValidation.ValidationRegistry()
    stage = Usd.Stage.Open(str(path))
    return UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)


@pytest.mark.parametrize("name", ["body.usdc", "motion.usdc", "groom.usdc", "shot.usda"])
def test_the_shipped_layers_have_no_finding(name):
    found = findings(SHOT / name)
    if name in ("motion.usdc", "groom.usdc"):  # alone, they lack what the body layer defines
        found = [e for e in found if "defaultPrim" in e.GetMessage() and "invalid" in e.GetMessage()]
    assert not found, [f"{e.GetName()}: {e.GetMessage()}" for e in found]


def test_the_shipped_body_is_a_person():
    rig = read_rigs(SHOT / "body.usdc")[0]
    body, character = rig.character.body, rig.character
    assert 1.5 < np.ptp(body.points[:, 1]) < 2.0 and abs(body.points[:, 1].min()) < 1e-3
    assert list(body.shapes) == list(SHAPES)
    assert np.allclose(body.joint_weights.sum(axis=1), 1, atol=1e-6)
    assert np.allclose(character.facing, np.eye(3), atol=1e-3)
    wanted = {"hips", "spine", "chest", "upper_chest", "neck", "head", "left_shoulder", "right_upper_arm", "left_foot"}
    assert wanted <= set(character.humanoid)
    leaves = [name.rsplit("/", 1)[-1] for name in character.skeleton.names]
    assert len(set(leaves)) == len(leaves) and all(leaf.replace("_", "").isalnum() for leaf in leaves)
    # Blend shapes leave the head on its joint: none of its vertices moves farther than heads differ in size.
    head = character.head_skin
    assert all(np.abs(offsets[head]).max() < 0.04 for offsets in body.shapes.values())


def test_a_network_reads_the_shipped_body_as_it_is_in_every_shape_of_training():
    character = read_rigs(SHOT / "body.usdc")[0].character
    assert character.body_shapes.all()
    for shape in np.random.default_rng(0).uniform(-0.6, 0.6, (200, len(SHAPES))):
        assert np.array_equal(measures_read(character, shape), body_measures(character, shape))


def test_the_scalp_is_the_upper_head():
    stage = Usd.Stage.Open(str(SHOT / "body.usdc"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Body/Skin"))
    faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)
    scalp = faces[np.array(UsdGeom.Subset(stage.GetPrimAtPath("/Body/Skin/scalp")).GetIndicesAttr().Get())]
    points = np.array(mesh.GetPointsAttr().Get())
    head = read_rigs(SHOT / "body.usdc")[0].character.skeleton.bind[:, :3, 3]
    assert 150 < len(scalp) < 2000
    assert points[scalp, 1].max() == points[:, 1].max()
    assert points[scalp, 1].min() > head[:, 1].max() - 0.06
    assert abs(points[scalp, 0].mean()) < 0.002


def small_body(shapes):
    """A body of one square face on two joints; `shapes` are factors of its points by name."""
    points = np.array([[0, 1.8, 0], [0.1, 1.8, 0], [0.1, 1.7, 0], [0, 1.7, 0]], float)
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[:, 1, 3] = [1.0, 1.6]
    offsets = {name: factor * points for name, factor in shapes.items()}
    skin = Body(points, np.array([[0, 1, 2], [0, 2, 3]]), np.ones((4, 1), int), np.ones((4, 1)), offsets)
    character = Character(Skeleton(["hips", "hips/head"], [-1, 0], bind), skin)
    return StatisticalBody(character, np.array([[0, 1, 2, 3]]), np.array([0]), np.full((4, 3), 0.5))


def test_a_body_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    body = small_body({"wide": 0.1})
    points, bind = body.character.body.points, body.character.skeleton.bind
    path = write_body(tmp_path / "made" / "body.usda", body)
    assert not findings(path)
    assert [p.name for p in path.parent.iterdir()] == ["body.usda"]
    again = read_rigs(path)[0].character
    assert np.allclose(again.skeleton.bind, bind) and np.allclose(again.body.points, points, atol=1e-6)
    with pytest.raises(NeuralocksError, match="end its name"):
        write_body(tmp_path / "body.fbx", body)
    monkeypatch.setattr("usd.assets.body.statistical_body", None)  # because it takes a minute
    with pytest.raises(NeuralocksError, match="not a folder, on the way"):
        write_body(path / "body.usda")


def test_a_shape_that_the_body_has_already_is_left_out(tmp_path):
    """As `heavy` of a body of weight 1: a shape without offsets would be reported by whatever reads the file."""
    (rig,) = read_rigs(write_body(tmp_path / "body.usda", small_body({"heavy": 0.0, "tall": 0.1})))
    assert list(rig.character.body.shapes) == ["tall"] and not rig.notes


@pytest.mark.parametrize(("name", "value"), [("size", 0.5), ("age", 2.0)])
def test_a_wrong_phenotype_is_named(name, value):
    with pytest.raises(NeuralocksError, match=name):
        statistical_body({name: value})
    assert name == "size" or name in DEFAULT_PHENOTYPE


@pytest.mark.parametrize(("unit", "up"), [(1.0, "Y"), (0.01, "Y"), (1.0, "Z"), (0.01, "Z")])
def test_an_animation_comes_back_as_written(tmp_path, unit, up):
    character = read_rigs(SHOT / "body.usdc")[0].character
    clip = random_clip(character, np.random.default_rng(1), 1.0, rate=24.0)
    stage = Usd.Stage.CreateNew(str(tmp_path / "clip.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, up)
    stage.SetTimeCodesPerSecond(24)
    write_animation(stage, "/Motion", character, clip)
    query = UsdSkel.Cache().GetAnimQuery(UsdSkel.Animation(stage.GetPrimAtPath("/Motion")))
    to_core = np.eye(4)
    if up == "Z":
        to_core[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    for row in (0, 7, 24):
        local = np.array(query.ComputeJointLocalTransforms(1.0 + row)).swapaxes(-1, -2)
        world = []
        for joint, parent in enumerate(character.skeleton.parents):
            world.append(local[joint] if parent < 0 else world[parent] @ local[joint])
        world = to_core @ np.array(world)
        world[:, :3, 3] *= unit
        assert np.allclose(world, clip.joints[row], atol=2e-5)


def test_the_shot_reads_as_she_acts():
    shot = read_shot(SHOT / "shot.usda")
    assert not shot.notes and len(shot.grooms) == 1 and shot.grooms[0].joint.endswith("/head")
    assert shot.grooms[0].groom.strand_count >= 3000
    clip, character = shot.rigs[0].clip, shot.rigs[0].character
    feet = [clip.joints[:, character.humanoid[f"{side}_foot"], :3, 3] for side in ("left", "right")]
    lower = np.min([foot[:, 1] for foot in feet], axis=0)
    stand = character.skeleton.bind[character.humanoid["left_foot"], 1, 3]
    assert lower.min() > stand - 0.01 and lower.max() > stand + 0.2  # she never sinks into the floor, and jumps
    still = clip.joints[-10:]
    assert np.abs(still - still[-1]).max() < 2e-3
    assert sum(path.stat().st_size for path in SHOT.iterdir()) < 12e6
    assert SKELETON == shot.rigs[0].path
