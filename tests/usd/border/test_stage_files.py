# SPDX-License-Identifier: Apache-2.0
"""USD files that are written again while this process holds them open."""

from usd.border.stage_files import open_stage, write_stage


def test_a_file_that_is_still_open_is_read_as_it_was_written_last(tmp_path):
    """USD gives whoever opens a file the layer that other code still holds."""
    path, held = tmp_path / "shot.usdc", []
    for prim in ("/One", "/Two"):
        write_stage(path, lambda stage, prim=prim: stage.DefinePrim(prim))
        held.append(open_stage(path))
        assert [str(each.GetPath()) for each in held[-1].Traverse()] == [prim]
    assert held[0].GetPrimAtPath("/Two")
