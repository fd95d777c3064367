# SPDX-License-Identifier: GPL-3.0-or-later
"""Hidden objects: Blender leaves their transforms and shape keys as in the last frame that showed them."""

from contextlib import contextmanager

import bpy

from ...session import session
from .visibility import enabled


@contextmanager
def watched(scene, layer, things):
    """In this block, Blender evaluates objects of a view layer even if they are hidden or disabled: an empty depends on them. Those
    that simply follow their parent need none: making and removing empties takes time in every frame. Gives whether there are any.
    """
    hidden, probes = [t for t in things if scene.library is None and _needs(t, layer)], []
    try:
        for thing in hidden:
            probes.append(bpy.data.objects.new("Neuralocks Probe", None))
            scene.collection.objects.link(probes[-1])
            _depend(probes[-1], thing)
        session.watched = {thing.name_full for thing in hidden}
        yield bool(hidden)
    finally:
        session.watched = set()
        for probe in probes:
            bpy.data.objects.remove(probe)


def evaluated_for_itself(thing, graph) -> bool:
    """Whether a depsgraph keeps an object up to date."""
    return graph.mode == "RENDER" or thing.name_full in session.watched or enabled(thing, graph.view_layer)


def _needs(thing, layer) -> bool:
    return not enabled(thing, layer) and (_moves(thing) or (thing.parent is not None and _needs(thing.parent, layer)))


def _moves(thing) -> bool:
    """Whether an object, or its shape, is moved by more than its parent, or by the parent in a way that only Blender knows."""
    keys = getattr(thing.data, "shape_keys", None)
    if thing.animation_data is not None or len(thing.constraints) or (keys and keys.animation_data):
        return True
    bone = thing.parent.data.bones.get(thing.parent_bone) if thing.parent_type == "BONE" else None
    return thing.parent_type not in ("OBJECT", "BONE") or (bone is not None and bone.use_relative_parent)


def _depend(probe, thing) -> None:
    probe.constraints.new("COPY_TRANSFORMS").target = thing
    if thing.type == "MESH":  # on its shape keys, too
        surface = probe.constraints.new("SHRINKWRAP")
        surface.target, surface.influence = thing, 0.0
