# SPDX-License-Identifier: Apache-2.0
"""USD files that are written again while this process holds them open, and files that are read only at times."""

import os

import pytest
from pxr import Sdf, Usd

from neuralocks_core.errors import NeuralocksError
from usd.border.stage_files import check_file, check_not_input, open_stage, write_stage


def test_a_file_that_is_still_open_is_read_as_it_was_written_last(tmp_path):
    """USD gives whoever opens a file the layer that other code still holds."""
    path, held = tmp_path / "shot.usdc", []
    for prim in ("/One", "/Two"):
        write_stage(path, lambda stage, prim=prim: stage.DefinePrim(prim))
        held.append(open_stage(path))
        assert [str(each.GetPath()) for each in held[-1].Traverse()] == [prim]
    assert held[0].GetPrimAtPath("/Two")


def test_a_value_clip_that_is_not_open_yet_is_not_written_over(tmp_path):
    clips = [tmp_path / f"hair.{number}.usda" for number in (1, 2)]
    for path in clips:
        write_stage(
            path, lambda stage: stage.DefinePrim("/Hair").CreateAttribute("x", Sdf.ValueTypeNames.Float).Set(1, 1)
        )

    def author(stage: Usd.Stage) -> None:
        prim = stage.DefinePrim("/Groom/Hair")
        prim.CreateAttribute("x", Sdf.ValueTypeNames.Float)
        played = Usd.ClipsAPI(prim)
        played.SetClipAssetPaths([Sdf.AssetPath(f"./{path.name}") for path in clips])
        played.SetClipPrimPath("/Hair")
        played.SetClipActive([(1, 0), (21, 1)])

    write_stage(tmp_path / "groom.usda", author)

    def refer(stage: Usd.Stage) -> None:
        instance = stage.DefinePrim("/Instance")
        instance.GetReferences().AddReference("./groom.usda", "/Groom")
        instance.SetInstanceable(True)
        broken = stage.DefinePrim("/Broken")
        Usd.ClipsAPI(broken).SetClips({"none": {"assetPaths": Sdf.AssetPathArray([Sdf.AssetPath("")])}})

    write_stage(tmp_path / "shot.usda", refer)
    for shot in ("groom.usda", "shot.usda"):
        stage = open_stage(tmp_path / shot)
        for path in clips:
            with pytest.raises(NeuralocksError, match=f"{path.name}: is "):
                check_not_input(path, stage)
    (tmp_path / "hair.3.usda").write_bytes(clips[0].read_bytes())
    check_not_input(tmp_path / "hair.3.usda", stage)


@pytest.mark.parametrize("rate", [0.0, 1e-310, float("nan"), float("inf")])
@pytest.mark.parametrize("referred", [False, True])
def test_a_layer_whose_samples_have_no_rate_is_named(tmp_path, rate, referred):
    """USD would ask for its samples without end; what has no samples has no use for a rate."""

    def shot(layer: str) -> str:
        def author(stage: Usd.Stage) -> None:
            stage.SetTimeCodesPerSecond(24)
            if referred:
                stage.DefinePrim("/Hair").GetReferences().AddReference(f"./{layer}", "/Hair")
            else:
                stage.GetRootLayer().subLayerPaths.append(f"./{layer}")

        return write_stage(tmp_path / f"shot_{layer}", author)

    for name in ("moves.usda", "stands.usda"):
        layer = Sdf.Layer.CreateNew(str(tmp_path / name))
        x = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, "/Hair"), "x", Sdf.ValueTypeNames.Float)
        x.default = 1.0
        if name == "moves.usda":
            layer.SetTimeSample(x.path, 1.0, 2.0)
        layer.timeCodesPerSecond = rate
        layer.Save()
    for path in (shot("moves.usda"), shot("shot_moves.usda")):
        with pytest.raises(NeuralocksError, match=r"^moves.usda: timeCodesPerSecond is (0|1e-310|nan|inf); set it to"):
            open_stage(path)
    assert open_stage(shot("stands.usda")).GetAttributeAtPath("/Hair.x").Get() == 1


@pytest.mark.parametrize(
    "within", ['def "Hair" ({clips}) {{\n}}', 'def "Hair" {{\nvariantSet "v" = {{\n"a" ({clips}) {{\n}}\n}}\n}}']
)
def test_a_layer_whose_clips_have_no_rate_is_named(tmp_path, within):
    """Its samples lie in files that are opened only when they are asked for."""
    clips = 'clips = { dictionary default = { asset[] assetPaths = [@./a.usda@]\n string primPath = "/Hair" } }'
    path = tmp_path / "clips.usda"
    path.write_text("#usda 1.0\n(timeCodesPerSecond = 0)\n" + within.format(clips=clips.replace(" }", "\n}")))
    with pytest.raises(NeuralocksError, match=r"^clips.usda: timeCodesPerSecond is 0; set it to"):
        open_stage(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are of POSIX systems")
def test_a_pipe_is_not_waited_for(tmp_path):
    """USD would wait for ever for somebody who writes to it."""
    os.mkfifo(tmp_path / "shot.usda")
    with pytest.raises(NeuralocksError, match="shot.usda: is a pipe or a device; name a USD file"):
        check_file(tmp_path / "shot.usda")
