# SPDX-License-Identifier: GPL-3.0-or-later
"""Live strands: the points of one hair object for the frame that is shown, a function of the scene as it is now."""

import zlib
from functools import lru_cache

import bpy
import numpy as np

from neuralocks_core.deformation.model_choice import suited
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import Material
from neuralocks_core.rotation import inverse

from ..live_state import Prepared
from ..scene.character.layers import graph_of, layer_of
from ..scene.character.placing import world
from ..scene.character.riding import on_hair_bone
from ..scene.drawing.clock import shown_frame
from ..scene.drawing.hidden_objects import evaluated_for_itself
from ..scene.drawing.windows import drawing, in_view_last, layer_shown
from ..scene.files.paths import check_found
from ..scene.hair import curves
from ..scene.hair.muting import mute_deformers, unmute_deformers
from ..scene.objects.live_objects import lively
from ..scene.objects.lookup import find, identity, in_scene
from ..services.hair.live import LiveHair
from ..services.panel.sliders import MATERIAL, MOTION
from ..services.rigs import rig as rig_service
from ..services.rigs.axes import to_core
from ..services.rigs.motion import TOLERANCE
from ..session import session
from . import joined_hair, point_edits, preparing
from .character_wind import blowing
from .models import load_model, model_path, named_model, stamp
from .pose import pose
from .unsampled import unsampled

EDITING = {"EDIT", "EDIT_CURVES", "SCULPT_CURVES"}


def update(hair, scene, graph, moved: bool, wait: bool, home=None) -> None:
    """Write the points of a hair object for the pose that `graph` has evaluated; rest hair, with a message that says why, if that
    is not possible, and rest hair while it is being prepared. The arguments are those of `view.update`; `home` is the scene that
    the hair is in, if that is another one.
    """
    try:
        _update(hair, scene, graph, moved, wait or at_once(graph), home or scene)
    except NeuralocksError as error:
        _give_up(hair, str(error))
    except ReferenceError:
        _give_up(hair, f"{hair.name_full}: something it depends on was deleted; choose the armature again")


def at_once(graph) -> bool:
    """Whether hair must be there when a call returns: a render is made, or nobody looks on."""
    return bpy.app.background or graph.mode == "RENDER"


def _update(hair, scene, graph, moved: bool, wait: bool, home) -> None:
    armature, sampled = _sampled_with(hair, home)
    place = world(hair, graph)
    joined_hair.settle(hair)
    point_edits.follow(hair, sampled, place)
    settings, core = hair.neuralocks_hair, to_core(sampled.motion.metres_per_unit)
    joints = pose(armature, sampled, scene, graph, moved, settings.resolve)
    frame = shown_frame(scene)
    row = sampled.motion.row(frame)
    if moved and row is not None and _elsewhere(hair, place, sampled, row, graph):
        sampled.stale = session.sampling.wanting = True
    to_local = inverse(core @ place)
    time = frame / sampled.motion.rate
    wind = blowing(armature).in_core()
    wanted = time, joints, to_local, material(settings), typed(settings, MOTION.name), wind, settings.resolve
    prepared = prepare(hair, sampled, wanted, wait)
    if prepared is None:
        show_rest(hair)
        return
    points = prepared.hair.points(*wanted)
    curves.keep_rest(hair.data, point_edits.intact(hair))
    mute_deformers(hair)
    point_edits.write(hair, points, place, prepared.rest)
    joined_hair.remember(hair, prepared.made_of[0])
    hair.data.update_tag()
    if graph.mode == "RENDER" and bpy.app.version < (4, 0):
        # The render of an older Blender shows the points of the previous frame unless the object is updated, too; with its
        # animation, because it is copied as the viewport has it, at another frame.
        hair.update_tag(refresh={"OBJECT", "DATA", "TIME"})
    session.said.messages.pop(hair.name_full, None)


def _sampled_with(hair, home) -> tuple:
    """The hair's armature and that one's sampled motion.

    Raises:
        NeuralocksError: the hair cannot move at present; says why.
    """
    armature = hair.neuralocks_hair.armature
    if armature is not None:
        check_found(armature)
    if armature is None or not in_scene(armature, home):
        raise NeuralocksError(
            f"{hair.name_full}: it has no armature in this scene; choose the character above and press Attach to Character"
        )
    if hair.mode in EDITING:
        session.hairs.pop(hair.name_full, None)
        raise NeuralocksError(f"{hair.name_full}: the hair is being edited; Live resumes when you leave this mode")
    if problem := on_hair_bone(hair):
        raise NeuralocksError(problem)
    sampled = session.rigs.get(armature.name_full)
    if sampled is None:
        raise unsampled(armature.name_full)
    if hair.name_full not in sampled.motion.places:
        sampled.stale = True
        raise unsampled(armature.name_full, "its motion was sampled without this hair")
    return armature, sampled


def _elsewhere(hair, place: np.ndarray, sampled, row: int, graph) -> bool:
    """Whether the hair object, which is at `place`, or a body has been moved since the motion was sampled."""
    things = [hair, *(body for name in sampled.bodies if (body := find(name)) is not None)]
    now = {o.name_full: place if o == hair else world(o, graph) for o in things if evaluated_for_itself(o, graph)}
    places = sampled.motion.places
    return any(np.abs(at - places[name][row]).max() > TOLERANCE for name, at in now.items() if name in places)


def prepare(hair, sampled, wanted: tuple, wait: bool) -> Prepared | None:
    """The hair bound to its model, prepared once, and again if an undo or an edit has changed what it was prepared from.

    Args:
        hair, sampled: the hair object, and the motion of what carries it.
        wanted: arguments of `LiveHair.points` for the frame that is shown.
        wait: prepare it now.

    Returns:
        None while a thread prepares it; the frame is drawn again when it is done.
    """
    name = hair.name_full
    if name in session.preparing and not wait:
        return None
    prepared = session.hairs.get(name)
    if prepared is not None and not known(hair):
        _let_go(prepared.of)
        session.doubtful.add(name)
    path = model_path(hair)
    if prepared is not None and prepared.file != (path, stamp(path)):
        session.doubtful.add(name)
    if prepared is None or name in session.doubtful or prepared.hair.character is not sampled.carrying(name):
        made_of, make = _recipe(hair, sampled, wanted)
        if prepared is None or prepared.made_of != made_of:
            session.forget(name)
            if not wait:
                preparing.start(name, make, _arrived)
                return None
            prepared = make(lambda done, total: None)
        prepared = session.hairs[name] = prepared._replace(of=_which(hair))
        session.doubtful.discard(name)
    prepared.hair.follow(sampled.clip)
    return prepared


def known(hair) -> bool:
    """Whether what was prepared, or is being prepared, belongs to the curves that this hair object has now."""
    prepared = session.hairs.get(hair.name_full)
    return hair.name_full in session.preparing if prepared is None else prepared.of == _which(hair)


def _which(hair) -> tuple:
    """Curves, their object, and what shows at once that they are others: a later groom may get the name of a deleted one, and
    strands may be added or removed outside of the edit modes.
    """
    data = hair.data
    return identity(data), identity(hair), len(data.points), len(data.curves)


def _let_go(of: tuple) -> None:
    """Restore the rest shape of the curves that a live hair object had before it got others, unless another object moves them."""
    for left in bpy.data.hair_curves:
        if identity(left) == of[0] and left not in _moved():
            curves.restore_rest(left)


def _moved() -> set:
    """Curves of all live hair objects of the file."""
    return {hair.data for hair in lively(bpy.data.objects).hairs}


def _recipe(hair, sampled, wanted: tuple):
    """What the prepared hair is made of, for comparison, and a function of a progress callback that makes it without Blender, with
    all that its first frame needs.
    """
    name, data, path, character = hair.name_full, hair.data, model_path(hair), sampled.carrying(hair.name_full)
    own, counts, place = curves.points(data), curves.counts(data), sampled.bind_places[name]
    radius, of = curves.radius(data), _which(hair)
    named = named_model(hair)
    # The hair keeps its character alive, so no other one gets its id.
    file = path, stamp(path)
    made_of = zlib.crc32(own), zlib.crc32(counts), place.tobytes(), file, named, id(character)

    def make(say) -> Prepared:
        groom = rig_service.groom(name, own, counts, place, sampled.bind_metres, radius)
        model = load_model(str(suited(named, character, groom)))
        live = LiveHair(groom, character, model, lambda done: say(0.8 * done, 1))
        live.follow(sampled.clip)
        live.points(*wanted)
        return Prepared(live, made_of, own, of, file)

    return made_of, make


def _arrived(name: str) -> None:
    """Show hair that has just been prepared, in all scenes that it is in and that have been shown."""
    hair = find(name)
    if hair is None or not hair.neuralocks_hair.live or session.paused:
        return
    armature = hair.neuralocks_hair.armature
    shown = [scene for scene in hair.users_scene if any(layer.depsgraph for layer in scene.view_layers)]
    drawn = {each: home for home in shown for each in drawing(home) if each not in shown}  # where the hair is a guest
    for scene in in_view_last([*shown, *drawn]):
        layer = layer_of(armature, scene) if armature is not None else None
        update(hair, scene, graph_of(scene, layer or layer_shown(scene)), False, False, drawn.get(scene))


def material(settings) -> np.ndarray:
    """Log-ratios (4,) of the sliders, read as a bake reads them."""
    return _log_ratios(*material_words(settings))


@lru_cache
def _log_ratios(*words: str) -> np.ndarray:
    """Log-ratios (4,) of a material in words, cached: between most frames nobody moves a slider."""
    found = Material.parse(words).log_ratios()
    found.flags.writeable = False
    return found


def typed(settings, name: str) -> float:
    """A slider's value as a user would type it, without single-precision digits, so that a bake made elsewhere with the number
    shown is the same.
    """
    return round(getattr(settings, name), 6)


def material_words(settings) -> list[str]:
    """The sliders as `NAME=VALUE` words of the command line."""
    return [f"{slider.name}={typed(settings, slider.name):.9g}x" for slider in MATERIAL]


def rest(hair) -> None:
    """Live is over for this hair: rest shape and modifiers as before, nothing kept."""
    session.forget(hair.name_full)
    show_rest(hair)
    joined_hair.forget(hair)


def show_rest_left(things) -> None:
    """Restore the rest shape of those curves that nothing live moves: for example, live hair was joined to them."""
    for thing in things:
        if thing.type != "CURVES" or thing.neuralocks_hair.live:
            continue
        if thing.data.library is None and curves.has_rest(thing.data) and thing.data not in _moved():
            _restore(thing)


def show_all_rest() -> None:
    """Restore the rest shapes of all curves of the file, also those that live hair left behind, in no scene or with no object."""
    for thing in bpy.data.objects:
        if thing.type == "CURVES":
            joined_hair.settle(thing)
    for data in bpy.data.hair_curves:
        if data.library is None:
            curves.restore_rest(data)
    session.shown.written.clear()


def show_rest(hair) -> None:
    """Restore the hair's rest shape and modifiers; hair that was converted to another type has no rest shape."""
    if hair.type == "CURVES" and hair.data.library is None:
        _restore(hair)
    unmute_deformers(hair)


def _restore(hair) -> None:
    """Restore the rest shape of an object's curves, also that of hair joined to them."""
    joined_hair.settle(hair)
    curves.restore_rest(hair.data)
    point_edits.forget(hair)


def _give_up(hair, message: str) -> None:
    """Show rest hair and say why, instead of hair of another frame."""
    show_rest(hair)
    session.said.messages[hair.name_full] = message
