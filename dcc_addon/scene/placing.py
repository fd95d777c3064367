# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an object stands, and modifiers that would move its hair a second time."""

import json

import numpy as np

from .armature import matrix
from .watched import evaluated_for_itself

MOVERS = {"GeometryNodeDeformCurvesOnSurface", "GeometryNodeXPBDSolver"}
"""Nodes at the heart of the modifiers that Blender puts on new hair, Surface Deform and since 5.2 Hair Dynamics."""


def world(thing, graph) -> np.ndarray:
    """World transform (4, 4) of an object as `graph` has it. What is hidden or excluded Blender may leave where it was in
    another frame, without telling: its place then comes from its parent's, where nothing else moves it.
    """
    evaluated, plain = thing.evaluated_get(graph), not len(thing.constraints) and thing.animation_data is None
    if evaluated.is_evaluated and (evaluated_for_itself(thing, graph) or not plain):
        return matrix(evaluated.matrix_world)
    own, parent = matrix(thing.matrix_basis), thing.parent
    if parent is None:
        return own
    place = world(parent, graph)
    pose = parent.evaluated_get(graph).pose
    bone = pose.bones.get(thing.parent_bone) if pose and thing.parent_type == "BONE" else None
    if bone is not None:  # bone parents count from the tail
        tail = np.eye(4)
        tail[1, 3] = bone.bone.length
        place = place @ matrix(bone.matrix) @ tail
    return place @ matrix(thing.matrix_parent_inverse) @ own


def mute_deformers(hair, kept: str = "muted") -> None:
    """Switch off, and remember in the setting `kept`, modifiers that make the hair follow the surface or simulate it: the
    live view, or a cache, has already done that.
    """
    settings = hair.neuralocks_hair
    text = getattr(settings, kept)
    found = _remembered(text)
    for modifier in hair.modifiers:
        if (modifier.show_viewport or modifier.show_render) and _moves(modifier):
            if modifier.name not in found:
                found[modifier.name] = _before(hair, modifier, found)
            modifier.show_viewport = modifier.show_render = False
    if found and (now := json.dumps(found)) != text:
        setattr(settings, kept, now)


def unmute_deformers(hair, kept: str = "muted") -> None:
    """Switch them on again as they were."""
    settings = hair.neuralocks_hair
    if not getattr(settings, kept):  # to write it would be an update of the hair, which may call here again
        return
    found = _remembered(getattr(settings, kept))
    renamed = iter(_renamed(hair, found))
    for name, (viewport, render) in found.items():
        modifier = hair.modifiers.get(name) or next(renamed, None)
        if modifier is not None:
            modifier.show_viewport, modifier.show_render = viewport, render
    setattr(settings, kept, "")


def _before(hair, modifier, found: dict) -> list[bool]:
    """How to show a modifier again that is not among those remembered: as it is shown now; or, where it is one of those,
    was renamed and then switched on by hand in one place, as that one.
    """
    gone = [name for name in found if name not in hair.modifiers]
    if modifier.show_viewport != modifier.show_render and len(gone) > len(_renamed(hair, found)):
        return found.pop(gone[-1])
    return [modifier.show_viewport, modifier.show_render]


def _renamed(hair, found: dict) -> list:
    """Modifiers that are off and not among those remembered by name."""
    off = [m for m in hair.modifiers if not (m.show_viewport or m.show_render) and _moves(m)]
    return [modifier for modifier in off if modifier.name not in found]


def _remembered(text: str) -> dict[str, list[bool]]:
    """Whether each modifier was shown in the viewport and in renders, by name."""
    try:
        return json.loads(text or "{}")
    except json.JSONDecodeError:
        return {}


def _moves(modifier) -> bool:
    cached = modifier.type == "MESH_SEQUENCE_CACHE"
    return cached or (modifier.type == "NODES" and _moves_hair(modifier.node_group))


def _moves_hair(tree, depth: int = 0) -> bool:
    if tree is None or depth > 8:
        return False
    for node in tree.nodes:
        if node.bl_idname in MOVERS:
            return True
        if node.bl_idname == "GeometryNodeGroup" and _moves_hair(node.node_tree, depth + 1):
            return True
    return False
