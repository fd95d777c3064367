# SPDX-License-Identifier: GPL-3.0-or-later
"""Training in the background: Blender stays usable, the panel shows how far it is."""

import os
import tempfile
from pathlib import Path
from typing import NamedTuple

import bpy
from bpy.props import EnumProperty

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.model_file import SUFFIX
from neuralocks_core.training.work_folder import abandon, reserve

from ..live.view import refresh
from ..scene.drawing.redraw import redraw
from ..scene.export import write_shot
from ..scene.files.paths import MODELS, check_own, library_of
from ..scene.files.save_as import named_here, set_path
from ..scene.hair import curves
from ..scene.objects.lookup import find, identified, identity, named
from ..services.panel.panel_errors import for_the_panel
from ..services.rigs.names import file_label
from ..services.training.trainers import Trainers
from ..services.training.training_job import TrainingJob, default_python, installing
from ..services.work.temporary import temporary_folder
from ..services.work.threaded import Threaded, loading
from ..session import session
from .base import ONCE, Hardened, Stepwise, sampling, shown_armature, shown_hair

_running: list["_Training"] = []
"""One at most. Not in the session, which ends with its file: a training continues while other files are opened."""
_trainers = Trainers()


def job() -> TrainingJob | None:
    """The training that runs or has just ended."""
    return _running[0].job if _running else None


def notes() -> list[str]:
    """What an artist should know about the running training, or else the last one, in the words of the panel."""
    return _running[0].notes() if _running else session.said.trained_notes


def stop() -> None:
    """Cancel the running training and forget it."""
    if _running:
        _running[0].job.cancel()
        _running[0].folder.cleanup()
        _running.clear()
    for timer in (watch, await_answer):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)


def training_python() -> str:
    """The interpreter named in the preferences, or one found beside the packages."""
    addon = bpy.context.preferences.addons.get(__package__.rsplit(".", 1)[0])
    chosen = addon.preferences.python.strip() if addon is not None and addon.preferences else ""
    return os.path.expanduser(bpy.path.abspath(chosen)) if chosen else default_python()


def known_problem() -> str | None:
    """Why training cannot run here, with the remedy; None while the interpreter is first asked, which takes seconds. One that could
    not train is asked again, and the panel is redrawn with its answer.
    """
    answer = _trainers.known(training_python())
    if _trainers.asking and not bpy.app.timers.is_registered(await_answer):
        bpy.app.timers.register(await_answer, first_interval=0.2, persistent=True)
    return answer


def await_answer() -> float | None:
    """Blender's timer: redraws the panel once an interpreter has answered; seconds until the next look, or None then."""
    if _trainers.asking:
        return 0.2
    redraw()
    return None


class NEURALOCKS_OT_copy_install(Hardened, bpy.types.Operator):
    """Copy the command that installs what training needs, to paste into a terminal"""

    bl_idname = "neuralocks.copy_install"
    bl_label = "Copy Install Command"
    bl_options = {"REGISTER"}

    def work(self, context):
        context.window_manager.clipboard = installing()
        return "The command is copied; paste it into a terminal"


class NEURALOCKS_OT_train(Stepwise, bpy.types.Operator):
    """Train a model for this character in the background; Blender stays usable"""

    bl_idname = "neuralocks.train"
    bl_label = "Train for This Character"
    bl_options = {"REGISTER"}

    kind: EnumProperty(
        name="Kind",
        description="What the model is for",
        items=[("strands", "Strands", "Strand hair"), ("rig", "Bones", "Hair bones")],
        default="strands",
        **ONCE,
    )

    def steps(self, context):
        running = job()
        if running is not None and running.running:
            raise NeuralocksError("Training: one is running already; wait for it or cancel it")
        armature, scene = shown_armature(context), context.scene
        target = shown_hair(context, armature) if self.kind == "strands" else armature
        check_own(target)  # it gets the model
        if self.kind == "strands":
            curves.check(target)
        python, name, wanted = training_python(), armature.name_full, target.name_full
        asking = Threaded(lambda _: _trainers.look(python), "Checking what training needs", leave=True)
        if problem := (yield from asking.steps()):
            raise NeuralocksError(problem)
        yield from loading("usd.assets.scene_writer")
        sampled = yield from sampling(context, named(name))
        armature, target = named(name), named(wanted)
        stop()
        folder, out = temporary_folder(), None
        try:
            character = Path(folder.name) / "character.usdc"
            hairs = [target] if self.kind == "strands" else []
            prims = yield from write_shot(character, armature, sampled, hairs, share=1.0)
            armature, target = named(name), named(wanted)
            out = _reserved(target.name_full)
            settings = {
                "kind": self.kind,
                "character": str(character),
                "out": out,
                "minutes": scene.neuralocks.train_minutes,
                "chains": sampled.rig.patterns(armature.neuralocks_character.chains),
                "head": sampled.character.skeleton.names[sampled.character.head],
            }
            _running.append(_Training(TrainingJob(python, settings), _Target.of(target, self.kind), folder, prims))
        except BaseException:
            folder.cleanup()
            if out is not None:
                abandon(out)
            raise
        session.said.trained, session.said.trained_notes = None, []
        bpy.app.timers.register(watch, first_interval=0.5, persistent=True)
        return f"Training a model for {target.name_full} in the background"


class NEURALOCKS_OT_cancel_training(Hardened, bpy.types.Operator):
    """Stop the training that runs in the background"""

    bl_idname = "neuralocks.cancel_training"
    bl_label = "Cancel Training"
    bl_options = {"REGISTER"}

    def work(self, _context):
        stop()
        return "Training cancelled"


class _Target(NamedTuple):
    """What a training is for: the object and the file that it is in, since an object of its name in another file is not meant."""

    name: str
    kind: str
    identity: object
    file: str

    @classmethod
    def of(cls, thing, kind: str) -> "_Target":
        return cls(thing.name_full, kind, identity(thing), bpy.data.filepath)

    def found(self):
        """The object, even if it was renamed or its file was reopened; None if it is not in this file."""
        thing = identified(self.identity)
        if thing is None and self.file and self.file == bpy.data.filepath:
            thing = find(self.name)
        return thing

    def followed(self) -> "_Target":
        """The same, by the name and in the file that the object has now: that file may be reopened before the training ends."""
        thing = identified(self.identity)
        return self if thing is None else self.of(thing, self.kind)


class _Training(NamedTuple):
    """A running process, what it is for, the folder with what it reads, and the objects of the prims in it."""

    job: TrainingJob
    target: _Target
    folder: tempfile.TemporaryDirectory
    prims: dict[str, str]

    def notes(self) -> list[str]:
        """Its notes, about objects and in the words of the panel."""
        return [for_the_panel(note, self.prims) for note in self.job.notes]


def finish() -> str | None:
    """Take over the result of an ended training: the model goes to what it was trained for. A message for the panel, or
    None while it runs.
    """
    running = job()
    if running is None or running.running:
        return None
    wanted = _running[0].target
    name, target, well = wanted.name, wanted.found(), False
    if not running.succeeded:
        message = f"{name}: training failed: {running.failure()}"
    elif target is None:
        message = f"{name}: trained, but it is no longer in this file; choose its model by hand: {running.out}"
    else:
        setting = MODELS[wanted.kind]
        set_path(target, setting, named_here(running.out))
        if library_of(target, setting) is not None:  # for an override, the same path is relative to its own file
            set_path(target, setting, running.out)
        _remember()
        message, well = f"{target.name_full}: trained", True
    session.said.trained, session.said.trained_notes = (message, well), notes()
    stop()
    refresh(bpy.context.scene)
    return message


def _remember() -> None:
    """Push an undo step: without one, the next undo, of an earlier action, would also remove the model."""
    if bpy.app.background:
        return
    try:
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            bpy.ops.ed.undo_push(message="Trained model")
    except (RuntimeError, IndexError, AttributeError):  # no window, or one that takes no undo step now
        pass


def watch() -> float | None:
    """Blender's timer: seconds until the next look at the training, None when it has ended."""
    redraw()
    running = job()
    if running is None:
        return None
    _running[0] = _running[0]._replace(target=_running[0].target.followed())
    if not running.running:
        finish()
        return None
    return 0.5


def _reserved(name: str) -> str:
    """A new model file beside the .blend, or in the user's own folder while that is not saved; reserved, because another Blender
    may train for a character of the same name, or a file may be kept to be resumed on the command line.
    """
    label = file_label(name)
    folder = (
        Path(bpy.data.filepath).parent
        if bpy.data.filepath
        else Path(bpy.utils.user_resource("DATAFILES", path="neuralocks", create=True))
    )
    number = 1
    while not reserve(out := folder / f"{label}_{number}{SUFFIX}"):
        number += 1
    return str(out)


CLASSES = (NEURALOCKS_OT_copy_install, NEURALOCKS_OT_train, NEURALOCKS_OT_cancel_training)
