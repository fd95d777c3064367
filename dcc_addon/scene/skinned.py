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
    meshes = (o for o in bpy.data.objects if o.type == "MESH" and deformed(o, armature))
    return {name for mesh in meshes for name in moving_groups(mesh, armature) if name}


def skins(armature) -> tuple:
    """What tells in a redraw whether `bones_with_skin` may be others: the meshes that it deforms, how many groups each has, and which
    bones deform. The groups of a production rig take longer to look through than a redraw may.
    """
    meshes = (thing for thing in bpy.data.objects if thing.type == "MESH" and deformed(thing, armature))
    groups = tuple((mesh.name_full, len(mesh.vertex_groups)) for mesh in meshes)
    return groups, tuple(bone.use_deform for bone in armature.data.bones)
