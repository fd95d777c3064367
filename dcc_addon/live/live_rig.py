# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair bones: the rotations of the frame that is shown. Bones outside the hair are never touched."""

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import RigModel

from ..live_state import Bound
from ..scene.drawing.clock import shown_frame
from ..scene.keys import rotations
from ..services.hair.bones import LiveBones
from ..session import session
from .character_wind import blowing
from .models import model_path, stamp
from .pose import pose
from .unsampled import unsampled


def update(armature, scene, graph, moved: bool = False) -> None:
    """Turn the hair bones of a live rig; if that is not possible, restore them, with a message that says why."""
    try:
        _update(armature, scene, graph, moved)
    except NeuralocksError as error:
        show_rest(armature)
        session.said.messages[armature.name_full] = str(error)


def _update(armature, scene, graph, moved) -> None:
    sampled = session.rigs.get(armature.name_full)
    if sampled is None:
        raise unsampled(armature.name_full)
    before = session.chains.get(armature.name_full)
    bones, modes, _ = bound = bind(armature, sampled)
    if bound is not before:  # another model turned other bones, or a file remembers what nobody can have stored
        show_rest(armature)
    joints = pose(armature, sampled, scene, graph, moved)
    settings = armature.neuralocks_character
    time, wind = shown_frame(scene) / sampled.motion.rate, blowing(armature).in_core()
    turns = bones.turns([time], settings.rig_motion, joints[None], wind)[0]
    if not settings.rig_kept:
        settings.rig_kept = rotations.kept(armature, bones.bones)
    own = armature.pose.bones
    changed = [rotations.turn(own[name], modes[name], turn) for name, turn in zip(bones.bones, turns.tolist())]
    if any(changed):  # a tag causes an update, which calls this again: it must end once nothing changes
        if graph.mode == "RENDER":
            # What is tagged is copied to the render as the viewport has it, at another frame: so it is animated again.
            armature.update_tag(refresh={"OBJECT", "DATA", "TIME"})
        else:
            armature.update_tag()
    session.said.messages.pop(armature.name_full, None)


def bind(armature, sampled) -> Bound:
    """The rig model bound to this armature, once."""
    bound, path = session.chains.get(armature.name_full), model_path(armature, "rig")
    file = path, stamp(path)
    if bound is None or bound.file != file:
        bones = LiveBones.of(RigModel.load(path), sampled.rig, sampled.character)
        bound = Bound(bones, rotations.free_modes(armature, bones.bones), file)
        session.chains[armature.name_full] = bound
    rotations.check_free(armature, bound.bones.bones)
    bound.bones.follow(sampled.character, sampled.clip)
    return bound


def rest(armature) -> None:
    """Give the hair bones back the rotations that they had before."""
    session.chains.pop(armature.name_full, None)
    show_rest(armature)


def show_rest(armature) -> None:
    """Restore the earlier rotations, except of bones that were keyed meanwhile; the model stays bound."""
    settings = armature.neuralocks_character
    if settings.rig_kept:  # writing it is an update, which may call this again
        rotations.give_back(armature, settings.rig_kept, keyed=True)
        settings.rig_kept = ""
