# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair Curves from a hair particle system, key by key and child by child."""

from contextlib import ExitStack, contextmanager

import bpy
import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.rotation import flat

from ..services.hair.widths import radii
from .character.armature import matrix
from .character.binding import at_rest
from .drawing.visibility import homes_of
from .files.paths import check_own
from .hair import curves
from .objects.animated import moved

CHILD_STEPS = 4
"""A child gets at least two to this power segments."""


def choose(context, name: str = "") -> tuple:
    """The object and its particle system to convert: of this name, otherwise hair that is not converted yet, first of the active
    object, and there first the active system.

    Raises:
        NeuralocksError: there is none.
    """
    first = context.view_layer.objects.active  # `active_object` needs a window
    objects = [thing for thing in (first, *context.scene.objects) if thing is not None]
    if name:
        for thing in objects:
            if name in thing.particle_systems:
                return thing, thing.particle_systems[name]
        raise NeuralocksError(f"Particle hair: no object of this scene has a particle system '{name}'; choose another")
    for thing in objects:
        if left := waiting(thing):
            active = thing.particle_systems.active
            return thing, active if active in left else left[0]
    raise NeuralocksError(
        "Particle hair: no object of this scene has a particle system of type Hair that is shown; select the one with the "
        "hair, and show its particle system"
    )


def waiting(thing) -> list:
    """Hair systems of an object that are not converted yet: those that are, are hidden."""
    modifiers = [m for m in thing.modifiers if m.type == "PARTICLE_SYSTEM" and (m.show_viewport or m.show_render)]
    return [m.particle_system for m in modifiers if m.particle_system.settings.type == "HAIR"]


def convert(context, source, system, children: bool = True):
    """A new hair Curves object, parented to `source`, with the keys of its particle hair and its children as rendered, where they
    are with the rig at rest and moving shape keys off, of the same material and thickness.

    Blender's own conversion gives the points that are drawn (9 by default), not the keys that were groomed.

    Raises:
        NeuralocksError: the system has no hair, or its object belongs to another file.
    """
    check_own(source)
    settings, render = system.settings, context.scene.render
    if settings.type != "HAIR":
        raise NeuralocksError(f"{source.name}: '{system.name}' emits particles; choose a system of type Hair")
    shown = next(m for m in source.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system == system)
    children = children and settings.child_type != "NONE"
    with (
        at_rest(context, source),
        _shape_at_rest(source),
        _changed(shown, show_viewport=True),
        _changed(system, use_hair_dynamics=False),  # a simulated shape is not a groom
        _changed(settings, **_rendered(settings, children)),
        _mesh_as_rendered(source, shown, render),
    ):
        evaluated = source.evaluated_get(context.evaluated_depsgraph_get())
        counts, points = _keys(evaluated, system.name)
        if children:
            more, their_points = _children(context, source, evaluated, system)
            counts, points = np.concatenate([counts, more]), np.concatenate([points, their_points])
    thick, material = _radii(settings, counts, points), _material(source, settings)
    data = curves.create(f"{system.name} Hair", counts, points, thick, material)
    hair = bpy.data.objects.new(data.name, data)
    for home in homes_of(source, context):
        home.objects.link(hair)
    hair.parent = source
    if hasattr(data, "surface") and source.type == "MESH":
        data.surface = source
        if source.data.uv_layers.active:
            data.surface_uv_map = source.data.uv_layers.active.name
    shown.show_viewport = shown.show_render = False
    return hair


def _radii(settings, counts: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Radii (P,) with which the hair is drawn; its settings are diameters."""
    half = settings.radius_scale / 2
    root, tip = half * settings.root_radius, half * settings.tip_radius
    return radii(Groom(settings.name, points, counts), root, tip, settings.shape, settings.use_close_tip)


def _material(source, settings):
    """The material of the emitter's slot that the hair names; the last one if there are fewer slots."""
    slots = source.material_slots
    return slots[min(settings.material, len(slots)) - 1].material if slots else None


def _rendered(settings, children: bool) -> dict[str, int]:
    """Settings that make the viewport have all hair that a render has, with children if wanted."""
    if not children:
        return {"display_percentage": 100}
    number = "child_percent" if hasattr(settings, "child_percent") else "child_nbr"
    return {
        number: settings.rendered_child_count,
        "use_parent_particles": False,  # they are read key by key, and would be converted beside their children
        "display_percentage": 100,
        "display_step": max(settings.display_step, CHILD_STEPS),
    }


@contextmanager
def _changed(thing, **values):
    """In this block, a thing has these values."""
    kept = {name: getattr(thing, name) for name in values}
    try:
        for name, value in values.items():
            setattr(thing, name, value)
        yield
    finally:
        for name, value in kept.items():
            setattr(thing, name, value)


@contextmanager
def _mesh_as_rendered(source, system_modifier, render):
    """In this block, the viewport has what hair grows on, and as much hair on it, as renders have."""
    simple = {name: getattr(render, f"{name}_render") for name in ("simplify_subdivision", "simplify_child_particles")}
    with ExitStack() as changes:
        changes.enter_context(_changed(render, **simple))
        for curve in source.animation_data.drivers if source.animation_data else ():
            if curve.data_path.endswith(("].levels", "].show_viewport")):  # it would set them again
                changes.enter_context(_changed(curve, mute=True))
        for modifier in list(source.modifiers)[: list(source.modifiers).index(system_modifier)]:
            finer = {"levels": modifier.render_levels} if modifier.type in ("SUBSURF", "MULTIRES") else {}
            changes.enter_context(_changed(modifier, show_viewport=modifier.show_render, **finer))
        yield


@contextmanager
def _shape_at_rest(thing):
    """In this block, shape keys that keyframes or drivers move are off, whatever their value in this frame; those that are always
    on belong to the shape.
    """
    shapes = getattr(thing.data, "shape_keys", None)
    moving = moved(shapes.animation_data) if shapes else ()
    with ExitStack() as changes:
        for block in shapes.key_blocks if shapes else ():
            if block.path_from_id("value") in moving:
                changes.enter_context(_changed(block, mute=True))
        yield


def _keys(evaluated, system: str) -> tuple[np.ndarray, np.ndarray]:
    """Keys of each hair (S,), and all of them (P, 3) in the object's space."""
    modifier = next(m for m in evaluated.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system.name == system)
    particles = modifier.particle_system.particles
    if not len(particles):
        raise NeuralocksError(
            f"{evaluated.name}: '{system}' shows no hair; give it hair, or show the object and leave Edit Mode"
        )
    counts = np.array([len(p.hair_keys) for p in particles])
    points = np.array([key.co_object(evaluated, modifier, p) for p in particles for key in p.hair_keys], np.float32)
    return counts, points


def _children(context, source, evaluated, system) -> tuple[np.ndarray, np.ndarray]:
    """Points of each child (C,), and all of them (P, 3) in the object's space, by Blender's own conversion: its Python interface
    gives a child's points one by one, and those beyond its end as zeros.
    """
    if flat(matrix(evaluated.matrix_world)[:3, :3]):
        raise NeuralocksError(
            f"{source.name}: has zero scale, so the children of '{system.name}' cannot be read; give it a scale above zero"
        )
    before, objects = set(bpy.data.hair_curves), context.view_layer.objects
    active, selected = objects.active, list(objects.selected)
    with context.temp_override(object=source, active_object=source, particle_system=system):
        bpy.ops.curves.convert_from_particle_system()
    (made,) = set(bpy.data.hair_curves) - before
    groom = curves.counts(made), curves.shown(made)
    bpy.data.hair_curves.remove(made)  # and its object, which was made active and selected
    objects.active = active
    for thing in selected:
        thing.select_set(True)
    return groom
