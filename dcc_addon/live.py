# SPDX-License-Identifier: GPL-3.0-or-later
"""The live view: for every live hair object, the points of the frame that is shown. Everything is a function of the
scene as it is now.
"""

import os
from dataclasses import replace

import bpy
import numpy as np

from neuralocks_core import model as model_file
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material
from neuralocks_core.runtime import StrandModel

from . import live_rig
from .scene import curves
from .scene.placing import bind_place, mute_deformers, unmute_deformers
from .scene.sampling import key_of
from .services import rig as rig_service
from .services.axes import to_core
from .services.live import LiveHair
from .services.motion import TOLERANCE, similar
from .session import session

EDITING = {"EDIT", "EDIT_CURVES", "SCULPT_CURVES"}


def live_hairs(scene) -> list:
    """Hair objects of the scene that are live."""
    return [o for o in scene.objects if o.type == "CURVES" and o.neuralocks_hair.live]


def live_toggled(hair, context) -> None:
    """The Live switch was used."""
    session.messages.pop(hair.name, None)
    if hair.neuralocks_hair.live:
        session.forget(hair.name)
        from .background import request

        request()
        refresh(context.scene)
    else:
        rest(hair)


def loop_changed(armature, scene) -> None:
    """The frame range of this character repeats from now on, or no longer."""
    sampled = session.rigs.get(armature.name)
    if sampled is not None:
        sampled.clip = replace(sampled.clip, loop=armature.neuralocks_character.loop)
    refresh(scene)


def rest(hair) -> None:
    """Live is over for this hair: rest shape and modifiers as before, nothing kept."""
    session.forget(hair.name)
    show_rest(hair)


def show_rest(hair) -> None:
    """Give the hair its rest shape and its modifiers back."""
    if hair.data is not None and hair.data.library is None:
        curves.restore_rest(hair.data)
    unmute_deformers(hair)


def refresh(scene) -> None:
    """Show the hair of the current frame, outside of a frame change."""
    if session.paused or scene is None:
        return
    graph = bpy.context.evaluated_depsgraph_get() if bpy.context.scene == scene else None
    if graph is not None:
        update(scene, graph)


def update(scene, graph, moved: bool = False) -> None:
    """Write the points of every live hair for the pose that `graph` has evaluated.

    Args:
        scene: its frame says the time.
        graph: viewport or render depsgraph.
        moved: whether the frame has just changed, so that a pose unlike the sampled one means that the animation has
        changed.
    """
    if session.paused:
        return
    for hair in live_hairs(scene):
        try:
            _update(hair, scene, graph, moved)
        except NeuralocksError as error:
            _give_up(hair, str(error))
        except ReferenceError:
            _give_up(hair, f"{hair.name}: something it depends on was deleted; choose the armature again")
    live_rig.update(scene, graph, moved)


def _update(hair, scene, graph, moved: bool) -> None:
    armature = hair.neuralocks_hair.armature
    if armature is None or armature.name not in scene.objects:
        raise NeuralocksError(f"{hair.name}: it has no armature in this scene; choose the armature of the character")
    if hair.mode in EDITING:
        curves.restore_rest(hair.data)
        session.hairs.pop(hair.name, None)
        raise NeuralocksError(f"{hair.name}: the hair is being edited; live goes on when you leave the mode")
    sampled = session.rigs.get(armature.name)
    if sampled is None:
        raise NeuralocksError(f"{armature.name}: its motion is not sampled yet; press Sample Motion")
    if hair.name not in sampled.motion.places:
        sampled.stale = True
        raise NeuralocksError(f"{armature.name}: its motion was sampled without this hair; press Sample Motion")
    joints = pose(armature, sampled, scene, graph, moved)
    prepared = prepare(hair, armature, sampled)
    settings, core = hair.neuralocks_hair, to_core(sampled.motion.metres_per_unit)
    place = np.array(hair.evaluated_get(graph).matrix_world, float)
    to_local = np.linalg.inv(core @ place)
    time = scene.frame_current_final / sampled.motion.rate
    points = prepared.points(time, joints, to_local, material(settings), settings.motion, settings.resolve)
    curves.keep_rest(hair.data)
    mute_deformers(hair)
    curves.write(hair.data, points)
    hair.data.update_tag()
    session.messages.pop(hair.name, None)


def pose(armature, sampled, scene, graph, moved: bool) -> np.ndarray:
    """World joints (J, 4, 4) in the core's space: the sampled ones where the pose drawn is the sampled one, bit for
    bit as the bake reads them.
    """
    evaluated = armature.evaluated_get(graph)
    if not evaluated.is_evaluated:
        raise NeuralocksError(
            f"{armature.name}: the armature is hidden or in an excluded collection; show it so that it is evaluated"
        )
    reader = session.readers.get(armature.name)
    if reader is None or len(armature.pose.bones) != len(sampled.rig.bones):
        session.forget_motion(armature.name)
        raise NeuralocksError(f"{armature.name}: its bones have changed; press Sample Motion")
    world = reader.world(evaluated) @ sampled.trim
    row = sampled.motion.row(scene.frame_current_final)
    if row is not None:
        # Only the joints that hair is moved by: hair bones of their own, say, may be live themselves.
        read = sorted(set(sampled.character.humanoid.values()))
        if np.abs(world[read] - sampled.world[row, read]).max() < TOLERANCE:
            return sampled.clip.joints[row]
        if moved:
            sampled.stale = True
            from .background import request

            request()
    drawn = to_core(sampled.motion.metres_per_unit) @ world
    head = sampled.character.head
    drawn[head] = similar(drawn[head], armature.name)
    return drawn


def prepare(hair, armature, sampled) -> LiveHair:
    """The hair bound to its model, prepared once."""
    prepared = session.hairs.get(hair.name)
    if prepared is None:
        data = hair.data
        groom = rig_service.groom(
            hair.name,
            curves.points(data),
            curves.counts(data),
            bind_place(hair, armature, sampled),
            sampled.motion.metres_per_unit,
            curves.radius(data),
        )
        prepared = LiveHair(groom, sampled.character, load_model(hair.neuralocks_hair.model))
        session.hairs[hair.name] = prepared
    prepared.follow(sampled.clip)
    return prepared


def load_model(path: str) -> StrandModel:
    """The model of a path in the file, or the shipped one; read once while it does not change."""
    found = model_path(path)
    stamp = (os.path.getmtime(found), os.path.getsize(found)) if os.path.isfile(found) else None
    kept = session.models.get(found)
    if kept is None or kept[0] != stamp:
        kept = session.models[found] = stamp, StrandModel.load(found)
    return kept[1]


def model_path(path: str, kind: str = "strands") -> str:
    """Absolute path of a model named in the panel; the shipped one where it is empty."""
    if not path.strip():
        return str(model_file.shipped(kind))
    if path.startswith("//") and not bpy.data.filepath:
        raise NeuralocksError(
            f"{path}: a path relative to a file that is not saved; save the file or choose the model again"
        )
    return bpy.path.abspath(path)


def material(settings) -> np.ndarray:
    """Log-ratios (4,) of the sliders."""
    base = Material()
    return Material(
        base.bend * settings.bend,
        base.weight * settings.weight,
        base.damping * settings.damping,
        base.clumping * settings.clumping,
    ).log_ratios()


def material_words(settings) -> list[str]:
    """The sliders as `NAME=VALUE` words of the command line."""
    return [f"{name}={getattr(settings, name):.9g}x" for name in ("bend", "weight", "damping", "clumping")]


def _give_up(hair, message: str) -> None:
    """Show rest hair and say why, instead of hair of another frame."""
    show_rest(hair)
    session.messages[hair.name] = message


def needs_sampling(scene) -> list:
    """Armatures with something live on them whose motion is unknown or out of date."""
    wanted = {h.neuralocks_hair.armature for h in live_hairs(scene)} | set(live_rig.live_armatures(scene))
    result = []
    for armature in sorted((a for a in wanted if a is not None and a.name in scene.objects), key=lambda a: a.name):
        sampled = session.rigs.get(armature.name)
        if sampled is None or sampled.stale or sampled.key != key_of(armature, scene):
            result.append(armature)
    return result
