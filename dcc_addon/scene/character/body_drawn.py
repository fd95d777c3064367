# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the drawn body is from the shape that its weights and shape keys alone give. Hair is kept out of that shape only:
modifiers and settings of the armature modifier may move the body further.
"""

import numpy as np

from neuralocks_core.rotation import transformed

from ...services.rigs.axes import to_core
from ..drawing.hidden_objects import evaluated_for_itself
from ..objects.lookup import find
from .armature import matrix
from .body import left_behind, vertices

FAR = 0.005
"""Smaller distances are not reported [m]."""
REACH = 0.5
"""How far from the head's joint a distance matters [m]."""
REFINING = {"SUBSURF", "MULTIRES"}
"""Modifiers that put new vertices after a mesh's own."""
MOVING = set(
    "ARMATURE CAST CORRECTIVE_SMOOTH CURVE DISPLACE HOOK LAPLACIANDEFORM LAPLACIANSMOOTH LATTICE MESH_DEFORM SHRINKWRAP "
    "SIMPLE_DEFORM SMOOTH SURFACE_DEFORM WARP WAVE".split()
)
"""Modifiers that only move vertices."""


def drawn(mesh_object, graph) -> np.ndarray | None:
    """World points (V, 3) of a mesh's own vertices as they are drawn, in Blender's space. None if they cannot be told from those that
    a modifier makes, or if Blender does not evaluate it, or does so without its armature.
    """
    off = any(modifier.type == "ARMATURE" and not modifier.show_viewport for modifier in mesh_object.modifiers)
    if off or not evaluated_for_itself(mesh_object, graph):
        return None
    evaluated = mesh_object.evaluated_get(graph)
    own, all_drawn = len(mesh_object.data.vertices), vertices(evaluated.data)
    if len(all_drawn) != own and not (len(all_drawn) > own and _own_first(mesh_object)):
        return None
    return transformed(all_drawn[:own], matrix(evaluated.matrix_world))


def all_told(armature, bodies: tuple, seen: dict, character, clip, unit: float) -> tuple[str, ...]:
    """Notes on the bodies of an armature that are drawn elsewhere than expected.

    Args:
        bodies: their `BodyArrays`, together the body of the character.
        seen: what `drawn` returned for each of them, by row of the clip.
        character, clip: how hair knows them, in the core's space.
        unit: metres of Blender's unit.
    """
    off = np.zeros(len(bodies))
    for row, points in seen.items() if bodies else ():
        posed = character.posed_body(clip.joints[row], clip.shape[row])
        ends = np.cumsum([len(body.points) for body in bodies])[:-1]
        for number, (shown, own) in enumerate(zip(points, np.split(posed, ends))):
            if shown is not None and len(shown) == len(own):
                shown = transformed(shown, to_core(unit))
                near = np.linalg.norm(shown - clip.joints[row, character.head, :3, 3], axis=1) < REACH
                off[number] = max(off[number], np.linalg.norm(shown - own, axis=1)[near].max(initial=0.0))
    found = ((find(body.name), far) for body, far in zip(bodies, off) if far >= FAR)
    return tuple(_told(thing, far) for thing, far in found if not left_behind(thing, armature))


def _told(mesh_object, far: float) -> str:
    look = "look at its parent, its weights and its bones"
    why = f"{causes}; or {look}" if (causes := ", ".join(_causes(mesh_object))) else look
    return (
        f"{mesh_object.name_full}: hair is kept out of the shape that weights and shape keys give it; near the head it is drawn "
        f"up to {1000 * far:.0f} mm from that: {why}"
    )


def _own_first(mesh_object) -> bool:
    """Whether all modifiers that the viewport shows leave a mesh's own vertices first."""
    return all(m.type in REFINING | MOVING for m in mesh_object.modifiers if m.show_viewport)


def _causes(mesh_object) -> list[str]:
    """What may move vertices besides weights and shape keys."""
    found = []
    if mesh_object.show_only_shape_key and mesh_object.data.shape_keys:
        found.append("a pinned shape key")
    for modifier in mesh_object.modifiers:
        if modifier.type == "ARMATURE":
            settings = {"Preserve Volume": modifier.use_deform_preserve_volume, "Vertex Group": modifier.vertex_group}
            found += [f"{name} of '{modifier.name}'" for name, used in settings.items() if used]
            found += _bendy(modifier.object, mesh_object.vertex_groups)
        elif modifier.show_viewport:
            found.append(f"modifier '{modifier.name}'")
    return found


def _bendy(armature, groups) -> list[str]:
    """What to say of the bones with segments that move these vertex groups: hair is kept out of a body that bends at joints alone."""
    bones = [b.name for b in armature.data.bones if b.bbone_segments > 1 and b.name in groups] if armature else []
    if not bones:
        return []
    more = f" and {len(bones) - 1} more" if bones[1:] else ""
    return [f"Segments above 1 of the bendy bone '{bones[0]}'{more}"]
