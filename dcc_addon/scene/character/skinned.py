# SPDX-License-Identifier: GPL-3.0-or-later
"""Which meshes an armature deforms, and with which bones."""

import bpy


def deformed(mesh_object, armature) -> bool:
    """Whether an armature deforms a mesh, by a modifier or as its parent."""
    if mesh_object.parent == armature and mesh_object.parent_type == "ARMATURE":
        return True
    return any(m.type == "ARMATURE" and m.object == armature for m in mesh_object.modifiers)


def moving_groups(mesh_object, armature) -> tuple[str, ...]:
    """Names of the vertex groups, with an empty name for those that no bone moves."""
    bones, by_armature = armature.data.bones, deformed(mesh_object, armature)

    def moves(name: str) -> bool:  # a group may have the name of a bone that deforms nothing
        return name in bones and (bones[name].use_deform or not by_armature)

    return tuple(group.name if moves(group.name) else "" for group in mesh_object.vertex_groups)


def bones_with_skin(armature) -> set[str]:
    """Names of the bones that move a group of any mesh."""
    return {name for mesh in _meshes(armature) for name in moving_groups(mesh, armature) if name}


def groups_of_skin(armature) -> tuple[tuple[str, int], ...]:
    """Names of the meshes that an armature deforms, with their numbers of groups, which take longer to look through than a redraw may."""
    return tuple((mesh.name_full, len(mesh.vertex_groups)) for mesh in _meshes(armature))


def _meshes(armature):
    return (thing for thing in bpy.data.objects if thing.type == "MESH" and deformed(thing, armature))
