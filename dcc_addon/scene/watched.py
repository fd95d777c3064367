# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that are hidden, whose places and shape keys Blender leaves as they were in whatever frame it showed them last."""

from contextlib import contextmanager

import bpy

from ..session import session
from .animated import animated


@contextmanager
def watched(scene, layer, things):
    """Meanwhile Blender evaluates objects of a view layer, be they hidden or disabled: an empty depends on them. Those that
    hang plainly on what carries them go without: to make empties and to remove them takes time in every frame.
    """
    probes = [_probe(scene, thing) for thing in things if scene.library is None and _needs(thing, layer)]
    session.watched = {thing.name_full for thing, _ in probes}
    try:
        yield
    finally:
        session.watched = set()
        for _, probe in probes:
            bpy.data.objects.remove(probe)


def evaluated_for_itself(thing, graph) -> bool:
    """Whether a depsgraph keeps an object up to date: what is hidden by the eye of the outliner is hidden from view only."""
    if graph.mode == "RENDER" or thing.name_full in session.watched:
        return True
    layer = graph.view_layer
    return thing.hide_get(view_layer=layer) or thing.visible_get(view_layer=layer)


def _needs(thing, layer) -> bool:
    if "hide_viewport" in animated(thing.animation_data):
        return True
    if thing.hide_get(view_layer=layer) or thing.visible_get(view_layer=layer):
        return False
    keys = getattr(thing.data, "shape_keys", None)
    moved = thing.animation_data is not None or len(thing.constraints) or (keys and keys.animation_data)
    return bool(moved) or thing.parent_type not in ("OBJECT", "BONE") or _relative(thing)


def _relative(thing) -> bool:
    """Whether it is parented to a bone with Relative Parenting."""
    bone = thing.parent.data.bones.get(thing.parent_bone) if thing.parent_type == "BONE" else None
    return bone is not None and bone.use_relative_parent


def _probe(scene, thing):
    probe = bpy.data.objects.new("Neuralocks Probe", None)
    scene.collection.objects.link(probe)
    probe.constraints.new("COPY_TRANSFORMS").target = thing
    if thing.type == "MESH":  # its shape keys, too
        surface = probe.constraints.new("SHRINKWRAP")
        surface.target, surface.influence = thing, 0.0
    return thing, probe
