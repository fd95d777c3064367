# SPDX-License-Identifier: GPL-3.0-or-later
"""What an update of Blender's reports as edited, and what that puts out of date or in doubt. `changed` are the data blocks that it
names, as evaluated.
"""

import bpy

from . import background
from .live.live_strands import EDITING, known
from .live.point_edits import touched
from .scene.baked import body_record
from .scene.motion.after_undo import as_sampled
from .scene.motion.ground_shapes import follows
from .scene.objects.keyed_motion import concerns
from .scene.objects.lookup import find
from .session import session


def forget_data(graph, renewed: bool) -> None:
    """Weights and shapes of meshes, and points of grooms, that were edited are read again."""
    body_record.updated(graph.updates)
    for thing in (update.id for update in graph.updates):
        if isinstance(thing, bpy.types.Mesh):
            session.read.weights.pop(thing.name_full, None)
            session.read.edited |= set() if renewed else {thing.name_full}
        elif isinstance(thing, bpy.types.Curves):
            session.read.grooms.pop(thing.name_full, None)


def mark_stale(graph, changed, carriers, switched: set[str], renewed: bool) -> None:
    """Motions are out of date if a body was edited, whichever scene shows it, or keys of any action that was not just `switched`; they
    are wanted of these armatures. If everything is `renewed`, as by an undo, it is compared first.
    """
    if not (carriers or session.rigs):
        return
    own = [thing.original for thing in changed]
    edited = _edits_body(graph, own, renewed)
    keys = [thing for thing in own if isinstance(thing, bpy.types.Action) and thing.name_full not in switched]
    users = bpy.data.user_map(subset=keys) if keys else {}
    if not carriers:  # other keys show in poses, at which a render looks
        users = {key: each for key, each in users.items() if any(isinstance(user, bpy.types.Key) for user in each)}
    if not (edited or users):
        return
    found = []
    for name, sampled in session.rigs.items():
        moving = [action for action, each in users.items() if concerns(each, sampled.moved_by)]
        if (edited or moving) and not (renewed and as_sampled(name, sampled, moving, edited)):
            found.append(sampled)
            sampled.stale = True
    session.edits += 1
    session.sampling.failed.clear()
    lacking = any(armature.name_full not in session.rigs for armature in carriers)
    session.sampling.wanting = session.sampling.wanting or bool(found) or lacking


def retry_failed(changed) -> None:
    """Motions that could not be sampled are wanted again if one of their armatures or any rest pose was edited."""
    if any(isinstance(thing, bpy.types.Armature) or thing.name_full in session.sampling.failed for thing in changed):
        session.sampling.wanting = session.sampling.wanting or bool(session.sampling.failed)
        session.sampling.failed.clear()


def hair_placed(graph) -> bool:
    """Whether a live hair object was put elsewhere."""
    return any(update.is_updated_transform and _is_live(update.id.original) for update in graph.updates)


def doubt_motions(changed, objects, names: set[str], placed: bool) -> None:
    """Motions of armatures of these names may be out of date if one of these `objects`, by name, moves them, if hair was `placed`
    elsewhere, or if a scene was edited, where a body may be drawn or hidden.
    """
    moving = names.union(*(session.rigs[name].moved_by for name in names & session.rigs.keys()))
    if moving & objects or placed:
        background.doubt()
    elif any(isinstance(thing, bpy.types.Scene) for thing in changed):
        background.doubt(closely=False)


def edited(thing) -> bool:
    """Whether this is live hair that enters or leaves editing, or was given other strands or points."""
    if not _is_live(thing):
        return False
    return thing.mode in EDITING or not known(thing) or touched(thing)


def _edits_body(graph, own: list, renewed: bool) -> bool:
    """Whether an update, of these data blocks of the file, edits a sampled body by more than what its shape keys read; if everything
    is `renewed`, whether it may.
    """
    edited = {u.id.name_full for u in graph.updates if isinstance(u.id, bpy.types.Mesh) and u.is_updated_geometry}
    names = {name for rig in session.rigs.values() for name in rig.bodies} if edited else ()
    bodies = {body.data for name in names if (body := find(name)) is not None and body.data.name_full in edited}
    return any(renewed or not follows(mesh, own) for mesh in bodies)


def _is_live(thing) -> bool:
    """Whether this is a live hair object."""
    return isinstance(thing, bpy.types.Object) and thing.type == "CURVES" and thing.neuralocks_hair.live
