# SPDX-License-Identifier: GPL-3.0-or-later
"""Live strands: the points of one hair object for the frame that is shown, a function of the scene as it is now."""

import zlib

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material

from .models import load_model, model_path
from .pose import pose
from .scene import curves
from .scene.placing import bind_place, mute_deformers, unmute_deformers, world
from .services import rig as rig_service
from .services.axes import to_core
from .services.live import LiveHair
from .session import session

EDITING = {"EDIT", "EDIT_CURVES", "SCULPT_CURVES"}


def live_hairs(scene) -> list:
    """Hair objects of the scene that are live."""
    return [o for o in scene.objects if o.type == "CURVES" and o.neuralocks_hair.live]


def update(hair, scene, graph, moved: bool) -> None:
    """Write the points of a hair object for the pose that `graph` has evaluated; rest hair, with a message that says
    why, where that cannot be.
    """
    try:
        _update(hair, scene, graph, moved)
    except NeuralocksError as error:
        _give_up(hair, str(error))
    except ReferenceError:
        _give_up(hair, f"{hair.name_full}: something it depends on was deleted; choose the armature again")


def _update(hair, scene, graph, moved: bool) -> None:
    armature = hair.neuralocks_hair.armature
    if armature is None or armature.name_full not in scene.objects:
        raise NeuralocksError(
            f"{hair.name_full}: it has no armature in this scene; choose the armature of the character"
        )
    if hair.mode in EDITING:
        curves.restore_rest(hair.data)
        session.hairs.pop(hair.name_full, None)
        raise NeuralocksError(f"{hair.name_full}: the hair is being edited; live goes on when you leave the mode")
    sampled = session.rigs.get(armature.name_full)
    if sampled is None:
        session.wanting = True
        raise NeuralocksError(f"{armature.name_full}: its motion is not sampled yet; press Sample Motion")
    if hair.name_full not in sampled.motion.places:
        sampled.stale = session.wanting = True
        raise NeuralocksError(f"{armature.name_full}: its motion was sampled without this hair; press Sample Motion")
    joints = pose(armature, sampled, scene, graph, moved)
    prepared = prepare(hair, armature, sampled)
    settings, core = hair.neuralocks_hair, to_core(sampled.motion.metres_per_unit)
    to_local = np.linalg.inv(core @ world(hair, graph))
    time = scene.frame_current_final / sampled.motion.rate
    points = prepared.points(time, joints, to_local, material(settings), settings.motion, settings.resolve)
    curves.keep_rest(hair.data)
    mute_deformers(hair)
    curves.write(hair.data, points)
    hair.data.update_tag()
    session.messages.pop(hair.name_full, None)


def prepare(hair, armature, sampled) -> LiveHair:
    """The hair bound to its model, prepared once; again where an undo has changed what it was prepared from."""
    name, data, path = hair.name_full, hair.data, hair.neuralocks_hair.model
    prepared = session.hairs.get(name)
    if prepared is None or name in session.doubtful:
        own, counts, place = curves.points(data), curves.counts(data), bind_place(hair, armature, sampled)
        made_of = zlib.crc32(own), zlib.crc32(counts), place.tobytes(), model_path(path), armature.name_full
        if prepared is None or prepared.made_of != made_of:
            groom = rig_service.groom(name, own, counts, place, sampled.bind_metres, curves.radius(data))
            prepared = session.hairs[name] = LiveHair(groom, sampled.character, load_model(path))
            prepared.made_of = made_of
        session.doubtful.discard(name)
    prepared.follow(sampled.clip)
    return prepared


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


def rest(hair) -> None:
    """Live is over for this hair: rest shape and modifiers as before, nothing kept."""
    session.forget(hair.name_full)
    show_rest(hair)


def show_rest(hair) -> None:
    """Give the hair its rest shape and its modifiers back."""
    if hair.data is not None and hair.data.library is None:
        curves.restore_rest(hair.data)
    unmute_deformers(hair)


def _give_up(hair, message: str) -> None:
    """Show rest hair and say why, instead of hair of another frame."""
    show_rest(hair)
    session.messages[hair.name_full] = message
