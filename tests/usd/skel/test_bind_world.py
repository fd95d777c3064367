# SPDX-License-Identifier: Apache-2.0
"""Which part of a skeleton's parent transform is axes, and which is pose."""

from types import SimpleNamespace

import numpy as np
import pytest
from pxr import Gf, Usd, UsdSkel
from scipy.spatial.transform import Rotation

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.errors import NeuralocksError
from usd.shot.stage import read_shot
from usd.skel.bind_world import to_bind_world

from ..shots import JOINTS, POSITIONS, Recipe, edited, write_shot

STANDING = {"hips": (0, 1, 0), "head": (0, 1.7, 0.05), "left_foot": (0.1, 0.1, 0), "right_foot": (-0.1, 0.1, 0)}
GRAZING = {"hips": (0, 1.2, -1), "head": (0, 1.0, 1)}
DOG = {"hips": (0, 0.6, -0.4), "head": (0, 0.75, 0.5), "left_foot": (0.1, 0, -0.45), "right_foot": (-0.1, 0, -0.45)}
LYING = {"hips": (0, 0.1, 0), "head": (0, 0.1, 0.7), "left_foot": (0.1, 0.1, -0.9), "right_foot": (-0.1, 0.1, -0.9)}
CRAWLING = {"hips": (0, 0.5, 0), "head": (0, 0.6, 0.6), "left_foot": (0.1, 0, -0.6), "right_foot": (-0.1, 0, -0.6)}
SEATED = {"hips": (0, 0.5, 0), "head": (0, 1.1, 0), "left_foot": (0.1, 0, 0.45), "right_foot": (-0.1, 0, 0.45)}


def turned(axis: str, degrees: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    return matrix


def bind_world(joints: dict, placed: np.ndarray, built: np.ndarray | None = None) -> np.ndarray:
    """Joints (J, 3) in bind world, of a rig that was built in turned axes and is placed by its parents."""
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    bind[:, :3, 3] = list(joints.values())
    bind = bind if built is None else built @ bind
    source = SimpleNamespace(path="/Rig", names=list(joints), bind=bind, placement=SimpleNamespace(reference=placed))
    found = Humanoid({name: i for i, name in enumerate(joints)})
    border = SimpleNamespace(to_core=np.eye(4))
    return (to_bind_world(source, border, (placed @ bind)[None], found) @ bind)[:, :3, 3]


@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.parametrize("lean", [1, 20, 44, 62, 100])
def test_a_lean_of_the_parents_is_pose(axis, lean):
    for joints in (STANDING, {name: place for name, place in STANDING.items() if "foot" not in name}):
        here = bind_world(joints, turned(axis, lean))
        assert np.abs(here - list(joints.values())).max() < 1e-9


def test_quarter_turns_are_axes():
    """A rig built along Z stands by its parents' quarter turn, and leans by any further rotation."""
    for lean in (0, 25, 60):
        here = bind_world(STANDING, turned("z", lean) @ turned("x", -90), built=turned("x", 90))
        assert np.abs(here - list(STANDING.values())).max() < 1e-9


def test_what_was_built_askew_stands_as_it_is_placed():
    here = bind_world(STANDING, turned("x", -30), built=turned("x", 30))
    assert np.abs(here - list(STANDING.values())).max() < 1e-9


@pytest.mark.parametrize("joints", [GRAZING, DOG, LYING, CRAWLING, SEATED])
def test_what_does_not_stand_in_its_own_axes_is_left_in_them(joints):
    assert np.array_equal(bind_world(joints, np.eye(4)), list(joints.values()))


@pytest.mark.parametrize("joints", [DOG, SEATED])
def test_what_goes_on_four_legs_or_sits_leans_too(joints):
    for lean in (-40, -20, 20, 40):
        assert np.abs(bind_world(joints, turned("x", lean)) - list(joints.values())).max() < 1e-9


def test_a_head_alone_is_taken_for_upright_where_it_nearly_is():
    head = {"neck": (0, 1.5, 0), "head": (0, 1.6, 0.05)}
    assert np.abs(bind_world(head, turned("x", 25)) - list(head.values())).max() < 1e-9
    placed = turned("x", 46)
    assert np.abs(bind_world(head, placed) - list(head.values()) @ placed[:3, :3].T).max() < 1e-9


@pytest.mark.parametrize("recipe", [Recipe(), Recipe(unit=0.01, up="Z")])
def test_a_shot_on_a_slope(tmp_path, recipe):
    """Its bind pose is that of the same shot on level ground, its poses lean."""
    level = read_shot(write_shot(tmp_path, recipe, "level")).rigs[0]
    place = turned("x", 20)
    slope = read_shot(write_shot(tmp_path, Recipe(unit=recipe.unit, up=recipe.up, place=place), "slope")).rigs[0]
    assert np.abs(slope.character.skeleton.bind[:, :3, 3] - POSITIONS).max() < 1e-6
    assert np.abs(slope.clip.joints - place @ level.clip.joints).max() < 1e-5


@pytest.mark.parametrize("joint", ["hips/spine/neck", "hips/spine/neck/head"])
def test_a_head_that_a_scale_of_zero_hides_all_the_while_is_told_with_the_joint(tmp_path, joint):
    path = write_shot(tmp_path, Recipe())
    stage = Usd.Stage.Open(str(path))
    scales = [Gf.Vec3h(0, 0, 1) if name == joint else Gf.Vec3h(1) for name in JOINTS]
    UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion")).GetScalesAttr().Set(scales)
    stage.Save()
    with pytest.raises(NeuralocksError, match=f"^/Hero/Rig: joint '{joint}' is scaled to 0 x 0 x 1 .*leave it at 1"):
        read_shot(path)


@pytest.mark.parametrize("aside", [(3, 0, 0), (0, 0.05, 0)])
def test_a_rest_pose_that_stands_elsewhere_takes_no_hair_along(aside, tmp_path):
    """It says nothing about the space of bind transforms, as one does that shows them in the world where they are."""

    def moved(stage):
        skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/Rig"))
        rest = skeleton.GetRestTransformsAttr().Get()
        rest[0] = rest[0] * Gf.Matrix4d().SetTranslate(aside)
        skeleton.GetRestTransformsAttr().Set(rest)

    recipe = Recipe(bound="none")
    grooms = [
        read_shot(path).grooms[0].groom
        for path in (write_shot(tmp_path, recipe), edited(tmp_path / "other", moved, recipe))
    ]
    np.testing.assert_allclose(grooms[1].points, grooms[0].points, atol=1e-6)
