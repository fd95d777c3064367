# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on itself: enabled, disabled, and described in words."""

from pathlib import Path

import bpy

from tests.blender.checks import own_handlers


def lifecycle(folder: Path) -> None:
    """Enable, disable, enable, load another file: nothing is left behind, nothing is there twice."""
    import dcc_addon

    before = len(own_handlers())
    assert before > 5
    dcc_addon.unregister()
    assert not own_handlers()
    assert not [n for n in dir(bpy.types) if n.startswith("NEURALOCKS_")]
    assert not hasattr(bpy.types.Object, "neuralocks_hair")
    dcc_addon.register()
    assert len(own_handlers()) == before
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "empty.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "empty.blend"))
    assert len(own_handlers()) == before
    dcc_addon.unregister()
    assert not own_handlers()


def words(_folder: Path) -> None:
    """Every operator is found by Blender's search, and everything has a name and a tooltip."""
    import dcc_addon
    from dcc_addon import operators, properties

    assert dcc_addon.bl_info["name"] == "Neuralocks"
    for cls in operators.CLASSES:
        operator = getattr(bpy.ops.neuralocks, cls.bl_idname.split(".")[1])
        described = operator.get_rna_type()
        assert described.name == cls.bl_label and "INTERNAL" not in getattr(cls, "bl_options", ())
        assert described.description and not described.description.endswith("."), cls.bl_idname
        assert operator.poll(), "search hides what cannot run, and then nobody hears why"
        for prop in described.properties:
            assert prop.identifier == "rna_type" or prop.description, (cls.bl_idname, prop.identifier)
    for cls in properties.CLASSES:
        for prop in cls.bl_rna.properties:
            if prop.identifier in cls.__annotations__:
                assert prop.name and prop.description and not prop.description.endswith("."), prop.identifier
                if prop.type == "ENUM":
                    assert all(item.description for item in prop.enum_items), prop.identifier
