# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that *Deform Curves on Surface* must not move while the rest of its node tree runs: that node passes curves without a
UV map name unchanged. The name is kept in a property of the Curves, so it is saved, appended and undone with the hair.
"""

import bpy


def possible(data) -> bool:
    """Whether these Curves can be changed without changing another object's."""
    if data.library is not None or data.override_library is not None or shared(data):
        return False
    return hasattr(data, "surface_uv_map")


def shared(data) -> bool:
    """Whether several objects have these Curves. Blender counts their users, but one too many after its own Separate."""
    return data.users - data.use_fake_user > 1 and sum(thing.data == data for thing in bpy.data.objects) > 1


def unbind(data, kept: str) -> None:
    """Remove the UV map's name, and remember it under the name `kept`."""
    if possible(data) and data.surface_uv_map:
        data[_key(kept)] = data.surface_uv_map
        data.surface_uv_map = ""


def bind(data, kept: str) -> None:
    """Put the name back, unless another one was given meanwhile."""
    if data.library is None and _key(kept) in data:
        data.surface_uv_map = data.surface_uv_map or str(data[_key(kept)])
        del data[_key(kept)]


def _key(kept: str) -> str:
    return f"neuralocks_uv_map_{kept}"
