# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair Curves from a hair particle system, key by key."""

import bpy
import numpy as np

from neuralocks_core.errors import NeuralocksError

from . import curves
from .binding import at_rest


def convert(context, source, name: str = ""):
    """A new hair Curves object with the keys of the particle hair of `source`, parented to it, as they are where the
    rig is at rest.

    Blender's own conversion gives the points that are drawn (9 by default), not the keys that were groomed.

    Raises:
        NeuralocksError: there is no such system, or no hair in it.
    """
    system = source.particle_systems.get(name) if name else source.particle_systems.active
    if system is None:
        raise NeuralocksError(f"{source.name}: it has no particle system '{name}'; choose one of its own")
    if system.settings.type != "HAIR":
        raise NeuralocksError(f"{source.name}: '{system.name}' emits particles; choose a system of type Hair")
    with at_rest(context, source):
        counts, points = _keys(source.evaluated_get(context.evaluated_depsgraph_get()), system.name)
    data = curves.create(f"{system.name} Hair", counts, points)
    hair = bpy.data.objects.new(data.name, data)
    (source.users_collection[0] if source.users_collection else context.scene.collection).objects.link(hair)
    hair.parent = source
    if hasattr(data, "surface") and source.type == "MESH":
        data.surface = source
        if source.data.uv_layers.active:
            data.surface_uv_map = source.data.uv_layers.active.name
    shown = next(m for m in source.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system.name == system.name)
    shown.show_viewport = shown.show_render = False
    return hair


def _keys(evaluated, system: str) -> tuple[np.ndarray, np.ndarray]:
    """Keys of each hair (S,), and all of them (P, 3) in the object's space."""
    modifier = next(m for m in evaluated.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system.name == system)
    particles = modifier.particle_system.particles
    if not len(particles):
        raise NeuralocksError(f"{evaluated.name}: '{system}' has no hair; give it hair or choose another system")
    counts = np.array([len(p.hair_keys) for p in particles])
    points = np.array([key.co_object(evaluated, modifier, p) for p in particles for key in p.hair_keys], np.float32)
    return counts, points
