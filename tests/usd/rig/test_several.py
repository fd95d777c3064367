# SPDX-License-Identifier: Apache-2.0
"""Several characters with hair on joints, in one shot or as rows of one batch."""

import re
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.network import RigSampler
from usd.border.stopping import stoppable
from usd.rig.bake import bake_rig
from usd.rig.stage import BAKED, read_rigged_hair, read_rigged_hairs
from usd.shot.notes.missing import has_hair_joints

from ..rig_shots import EXAMPLE, hair_turns, model_for, small_shot


@pytest.fixture
def crowd(tmp_path):
    """Two characters that move alike, a third whose head stands still, a fourth with other hair, and one with a tail alone."""
    one, still = small_shot(tmp_path / "one.usda"), small_shot(tmp_path / "still.usda", head_moves=False)
    longer = small_shot(tmp_path / "longer.usda", step=0.11)
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name, file in (("A", one), ("B", one), ("Still", still), ("Longer", longer)):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(str(file))
    UsdSkel.Skeleton.Define(stage, "/Prop").GetJointsAttr().Set(["hips", "hips/tail_1"])
    stage.Save()
    model = model_for(read_rigged_hair(one))
    return tmp_path / "crowd.usda", model, bake_rig(one, tmp_path / "alone.usda", model).path


def test_every_character_with_the_models_chains_moves(crowd, tmp_path):
    shot, model, alone = crowd
    result = bake_rig(shot, tmp_path / "out.usda", model)
    assert [rig.skeleton for rig in result.rigs] == ["/A/Rig", "/B/Rig"]
    left = [note for note in result.notes if "is left out" in note]
    assert len(left) == 2 and left[0].startswith("/Longer/Rig: ") and "/Still/Rig: its head joint" in left[1]
    codes = [1, 7, 20]
    stage, wanted = Usd.Stage.Open(str(result.path)), hair_turns(alone, codes)
    for who, moves in (("A", True), ("B", True), ("Still", False), ("Longer", False)):
        source = UsdSkel.BindingAPI(stage.GetPrimAtPath(f"/{who}/Rig")).GetInheritedAnimationSource()
        assert (source.GetName() == BAKED) == moves
        if moves:
            np.testing.assert_array_equal(hair_turns(result.path, codes, who), wanted)
    with pytest.raises(NeuralocksError, match="4 skeletons have hair chains .*choose one with --skeleton"):
        read_rigged_hair(shot, model=model.chains)


def test_who_lacks_a_joint_of_the_model_is_named(tmp_path):
    """Also if only the model shows that the joints are hair."""
    one = small_shot(tmp_path / "one.usda")
    text = Path(one).read_text().replace("hair_", "strip_")
    Path(one).write_text(text)
    (tmp_path / "other.usda").write_text(text.replace("strip_2", "ribbon_2"))
    stage = Usd.Stage.CreateNew(str(tmp_path / "both.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name, file in (("A", "one"), ("B", "other"), ("C", "other")):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(f"./{file}.usda")
    stage.Save()
    model = model_for(read_rigged_hair(tmp_path / "one.usda", chains=["strip_0"]))
    result = bake_rig(tmp_path / "both.usda", tmp_path / "out.usda", model)
    assert [rig.skeleton for rig in result.rigs] == ["/A/Rig"]
    left = [note for note in result.notes if "is left out" in note]
    assert len(left) == 2 and all(note.startswith(f"/{who}/Rig: ") for who, note in zip("BC", left, strict=True)), left


def test_where_no_character_can_move_the_first_says_why(crowd, tmp_path):
    shot, model, _ = crowd
    stage = Usd.Stage.Open(str(shot))
    for name in ("A", "B"):
        stage.GetPrimAtPath(f"/{name}").SetActive(False)
    stage.Save()
    with pytest.raises(NeuralocksError, match="/Still/Rig: its head joint 'head' is not animated"):
        bake_rig(shot, tmp_path / "out.usda", model)
    assert not (tmp_path / "out.usda").exists()


@pytest.fixture
def hearing():
    """The tests may have been started deaf to Ctrl-C, as a shell's background jobs are."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("hearing")
@pytest.mark.parametrize("work", ["stage.check_authored", "bake.BoundHair.of", "bake.MovedHair"])
def test_who_stops_at_one_character_does_not_go_on_with_the_others(crowd, tmp_path, monkeypatch, work):
    """USD swallows Ctrl-C, and what it then says passes for something wrong with that character."""

    def swallowed(*_):
        monkeypatch.undo()
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise NeuralocksError("it, or a file it uses, is damaged")

    monkeypatch.setattr(f"usd.rig.{work}", swallowed)
    with pytest.raises(SystemExit), stoppable():
        if work.startswith("stage"):
            read_rigged_hairs(crowd[0])
        else:
            bake_rig(crowd[0], tmp_path / "out.usda", crowd[1])
    assert not (tmp_path / "out.usda").exists()


def test_the_next_is_baked_from_the_bake_of_the_one_before(crowd, tmp_path):
    """If characters need different models: the last layer moves all of them."""
    shot, model, alone = crowd
    bake_rig(shot, tmp_path / "first.usda", model, skeleton="/A/Rig")
    bake_rig(tmp_path / "first.usda", tmp_path / "second.usda", model, skeleton="/B/Rig")
    codes = [1, 7, 20]
    for who in ("A", "B"):
        np.testing.assert_array_equal(hair_turns(tmp_path / "second.usda", codes, who), hair_turns(alone, codes))


def test_the_documents_show_how_python_turns_one_or_many():
    text = (EXAMPLE.parents[1] / "docs/architecture.md").read_text("utf-8")
    (example,) = re.findall(r"```python\n(from neuralocks_core\.rig.*?)```", text, re.S)
    names = {}
    exec(example.replace('"examples/mesh_hair', f'"{EXAMPLE.as_posix()}'), names)
    who, model = names["who"], names["model"]
    assert names["turns"].shape == (3, 32, 4)
    rows = RigSampler(model.spec, who.character, who.clip).features([0.5, 1.0, 1.5])
    for times in (rows, rows[:1]):  # no hat is in it
        turns = model.evaluate(times)
        assert turns.shape == (len(times), 32, 4)
        np.testing.assert_allclose(names["turns"][: len(times)], turns, atol=1e-6)


@pytest.mark.parametrize(
    ("joints", "hairy"),
    [
        (["hips", "hips/tail_1"], False),
        (["hips", "hips/neck", "hips/neck/head", "hips/neck/head/tail_1"], True),
        (["hips", "hips/neck", "hips/neck/kopf", "hips/neck/kopf/fringe_1"], True),
        (["hips", "hips/chest", "hips/chest/fringe_1", "hips/chest/neck", "hips/chest/neck/kopf"], False),
        (["hips", "hips/ponytail_1"], True),
        (["Pony_hips", "Pony_hips/Pony_neck", "Pony_hips/Pony_neck/Pony_head"], False),
        (["Hat_neck", "Hat_neck/Hat_head", "Hat_neck/Hat_head/Hat_tail_1"], True),
    ],
)
def test_what_hangs_from_the_head_is_hair_whatever_the_head_is_called(joints, hairy):
    stage = Usd.Stage.CreateInMemory()
    skeleton = UsdSkel.Skeleton.Define(stage, "/Rig")
    skeleton.GetJointsAttr().Set(joints)
    assert has_hair_joints(skeleton.GetPrim()) == hairy
