# SPDX-License-Identifier: Apache-2.0
"""Rigs that we did not make: trained, baked and exported with their body joints and everything authored untouched."""

import numpy as np
import pytest
from pxr import Usd, UsdSkel

pytest.importorskip("torch")

from neuralocks_core.errors import NeuralocksError  # noqa: E402
from neuralocks_core.rig import RigModel  # noqa: E402
from neuralocks_core.rig.export_c import export_c  # noqa: E402
from neuralocks_core.training.rig.dynamic import train_dynamic  # noqa: E402
from neuralocks_core.training.rig.static import train_static  # noqa: E402
from usd.review.inspect import inspect  # noqa: E402
from usd.rig.bake import bake_rig  # noqa: E402
from usd.rig.stage import describe_chains, read_rigged_hair  # noqa: E402

from ..fbx_rigs import FRAMES, write_character  # noqa: E402
from ..rig_shots import rotations  # noqa: E402


def trained(hair, dynamic) -> RigModel:
    """A few steps: what it has learned does not matter, only that it comes out whole."""
    if dynamic:
        return train_dynamic(hair.rig, steps=3, clips=2, clip_seconds=1.0, batch=8, report_poses=0)
    return train_static(hair.rig, steps=3, batch=4, report_poses=0)


@pytest.mark.parametrize(("joints", "dynamic"), [(24, True), (62, False)])
def test_train_bake_export(tmp_path, joints, dynamic):
    moving, chains = write_character(tmp_path / "who.usda", joints)
    hair = read_rigged_hair(tmp_path / "who.usda")
    rows = describe_chains(hair.rig.chains)
    assert len(rows) == chains and sum(row["joints"] for row in rows) == moving
    assert min(row["joints"] for row in rows) == 1 and max(row["joints"] for row in rows) == 5
    assert all(0.05 < row["length [m]"] < 0.4 for row in rows)  # metres
    listed = inspect(tmp_path / "who.usda")["skeletons"][0]["hair chains"]
    assert [(row["name"], row["joints"]) for row in listed] == [(row["name"], row["joints"]) for row in rows]
    model = trained(hair, dynamic)
    export_c(model, tmp_path / "hair.h")
    model = RigModel.load(model.save(tmp_path / "hair.neuralocks"))
    bake_rig(tmp_path / "who.usda", tmp_path / "baked.usda", model)
    before, after = (Usd.Stage.Open(str(tmp_path / name)) for name in ("who.usda", "baked.usda"))
    skeletons = [UsdSkel.Skeleton(stage.GetPrimAtPath("/Fbx/Armature")) for stage in (before, after)]
    own, new = (UsdSkel.Animation(UsdSkel.BindingAPI(s.GetPrim()).GetInheritedAnimationSource()) for s in skeletons)
    assert own.GetPath() != new.GetPath()
    names = list(own.GetJointsAttr().Get())
    assert list(new.GetJointsAttr().Get()) == names
    is_hair = np.isin([n.rsplit("/", 1)[-1] for n in names], model.chains.names)
    assert is_hair.sum() == moving
    for name in ("translations", "scales"):
        a, b = (x.GetPrim().GetAttribute(name) for x in (own, new))
        assert a.GetTimeSamples() == b.GetTimeSamples()
        for code in a.GetTimeSamples() or [Usd.TimeCode.Default()]:
            assert a.Get(code) == b.Get(code)
    assert own.GetRotationsAttr().GetTimeSamples() == new.GetRotationsAttr().GetTimeSamples()
    for code in range(1, FRAMES + 1):
        a, b = rotations(own, code), rotations(new, code)
        assert (a[~is_hair] == b[~is_hair]).all()
        assert code == 1 or (a[is_hair] != b[is_hair]).any(axis=1).all()
    # The shot begins in the bind pose, at rest: there the network gives zero rotation, whatever the joints' orients.
    flip = np.sign(np.sum(rotations(own, 1) * rotations(new, 1), axis=1, keepdims=True))
    assert np.abs(rotations(own, 1) - flip * rotations(new, 1)).max() < (2e-2 if dynamic else 1e-5)


def test_names_whose_letters_an_exporter_lost_are_told_as_such(tmp_path):
    """Blender before 5.0 writes '_' for each byte of a Japanese name, so names of one length become the same."""
    write_character(tmp_path / "who.usda", 24)
    stage = Usd.Stage.Open(str(tmp_path / "who.usda"))
    joints = UsdSkel.Skeleton(stage.GetPrimAtPath("/Fbx/Armature")).GetJointsAttr()
    names = [str(name) for name in joints.Get()]
    joints.Set([*names[:-2], "______", "______"])
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="'______' is listed twice; export it with Unicode names allowed"):
        read_rigged_hair(tmp_path / "who.usda")


def test_names_that_are_no_paths_are_refused(tmp_path):
    """A ':' of a namespace is reported in one line: UsdSkel and every importer would see no joints at all."""
    write_character(tmp_path / "who.usda", 24, prefix="rig:")
    with pytest.raises(NeuralocksError, match="rig:Hips.*rename"):
        read_rigged_hair(tmp_path / "who.usda")
