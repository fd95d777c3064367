# SPDX-License-Identifier: GPL-3.0-or-later
"""Training from the panel."""

import shutil
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy

from neuralocks_core.errors import NeuralocksError
from tests.blender import scenes
from tests.blender.checks import MODEL, messages, refused
from tests.blender.panel import drawn


def training(folder: Path) -> None:
    """Train in another process: the model goes to the hair that it was trained for, and is named relative to this file; a second
    training at the same time is refused, and no exported character stays behind.
    """
    from dcc_addon.live.models import model_path

    strands = _in_training(folder)
    exported = Path(tempfile.tempdir)
    assert len(list(exported.iterdir())) == 1
    refused(bpy.ops.neuralocks.train, "one is running already")
    assert _ended() == ("Hair: trained", True)
    assert not list(exported.iterdir())
    assert strands.neuralocks_hair.model == "//Hair_1.neuralocks", "it does not move with the file"
    assert Path(model_path(strands)) == folder / "Hair_1.neuralocks"
    strands.neuralocks_hair.live = True
    bpy.context.scene.frame_set(9)
    assert "Hair" not in messages(), messages()


def notes_of_a_training(folder: Path) -> None:
    """Training's notes on the character are in the panel from its start, with the names of the artist's objects, and stay there
    after it has ended, until the next one.
    """
    from dcc_addon.operators import training as operator
    from dcc_addon.session import session

    said = ("/Character/Hair_Hair: name it with --head JOINT", "/Character/Rig: has no neck")
    shown = ("Hair: choose it as Head Bone", "Rig: has no neck")
    strands = _in_training(folder, said)
    end = time.monotonic() + 60
    while not operator.notes() and time.monotonic() < end:
        time.sleep(0.1)
    assert operator.job().running and operator.notes() == [*shown]
    assert all(drawn().count(line) == 2 for line in shown), drawn()  # for strands and for bones
    assert _ended() == ("Hair: trained", True)
    assert all(drawn("INFO").count(line) == 2 for line in shown), drawn("INFO")
    assert strands.neuralocks_hair.model
    _in_training(folder)
    assert not operator.notes() and _ended() == ("Hair: trained", True) and not session.said.trained_notes


def training_leaves_nothing(folder: Path) -> None:
    """Neither a cancelled nor a failed training leaves files, and a full disk gives a line, not a traceback. Files beside a model
    of the next name belong to another training and stay.
    """
    from dcc_addon.operators import training as operator

    made = "open(settings['out'] + '.training/checkpoint.npz', 'w')"
    _in_training(
        folder,
        before=f"import os; os.makedirs(settings['out'] + '.training', exist_ok=True); {made}; sys.exit('broken')",
    )
    assert _ended() == ("Hair: training failed: broken", False)
    assert not list(folder.glob("*.training"))
    theirs = folder / "Hair_1.neuralocks.training"
    theirs.mkdir()
    (theirs / "checkpoint.npz").touch()
    _in_training(
        folder, before=f"import os; os.makedirs(settings['out'] + '.training', exist_ok=True); {made}; time.sleep(60)"
    )
    ours, end = folder / "Hair_2.neuralocks.training", time.monotonic() + 60
    while not (ours / "checkpoint.npz").exists() and time.monotonic() < end:
        time.sleep(0.05)
    assert bpy.ops.neuralocks.cancel_training() == {"FINISHED"}
    assert not ours.exists() and (theirs / "checkpoint.npz").exists()

    exported, tempfile.tempdir = tempfile.tempdir, str(folder / "nowhere")
    try:
        refused(bpy.ops.neuralocks.train, "nowhere", "cannot be written")
        refused(bpy.ops.neuralocks.report_card, "nowhere", "cannot be written")
    finally:
        tempfile.tempdir = exported
    assert operator.job() is None


def trained_in_two_blenders(folder: Path) -> None:
    """Two Blenders that train for characters of the same name, with files in one folder, write two models; a training that does not
    start reserves no name.
    """
    from dcc_addon.operators import training as operator

    with patch.object(operator, "TrainingJob", side_effect=NeuralocksError("no memory")):
        try:
            _in_training(folder)
        except RuntimeError as error:
            assert "no memory" in str(error)
    assert not list(folder.glob("*.training"))
    _in_training(folder)
    other, operator._running[:] = operator._running[:], []  # as if of another Blender
    strands = _in_training(folder)
    assert _ended() == ("Hair: trained", True) and strands.neuralocks_hair.model == "//Hair_2.neuralocks"
    operator._running[:] = other
    assert _ended() == ("Hair: trained", True) and strands.neuralocks_hair.model == "//Hair_1.neuralocks"
    assert not list(folder.glob("*.training"))


def training_meanwhile(folder: Path) -> None:
    """The object trained for may be renamed or deleted meanwhile, or another file opened, whose hair of the same name gets nothing:
    then a message says where the model is. Names may be longer than file names may.
    """
    from dcc_addon.operators import training as operator

    strands = _in_training(folder)
    strands.name = "H" * 255
    assert _ended() == (f"{strands.name}: trained", True)
    assert strands.neuralocks_hair.model == "//Hair_1.neuralocks"
    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    bpy.data.objects.remove(strands)
    said, well = _ended()
    assert "no longer in this file" in said and "HHH_1.neuralocks" in said and not well

    _in_training(folder)
    scenes.empty()
    strands = scenes.hair(scenes.armature(), 20)
    assert strands.name == "Hair" and bpy.app.timers.is_registered(operator.watch)
    said, well = _ended()
    assert "Hair: trained" in said and str(folder / "Hair_2.neuralocks") in said and not well
    assert not strands.neuralocks_hair.model

    _in_training(folder)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "train.blend"))
    assert _ended() == ("Hair: trained", True)
    assert bpy.data.objects["Hair"].neuralocks_hair.model == "//Hair_3.neuralocks"


def saved_in_training(folder: Path) -> None:
    """The file may be saved under another name meanwhile, and the hair renamed: the model goes to the hair there, also if that file
    is reopened.
    """
    from dcc_addon.live.models import model_path
    from dcc_addon.operators import training as operator

    strands, other = _in_training(folder), folder / "other"
    other.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(other / "later.blend"))
    assert _ended() == ("Hair: trained", True)
    assert Path(model_path(strands)).samefile(folder / "Hair_1.neuralocks")

    strands = _in_training(folder)
    strands.name = "Wig"
    bpy.ops.wm.save_as_mainfile(filepath=str(other / "later.blend"))
    assert operator.watch() and operator.job()  # as Blender's timer calls it where there is a window
    bpy.ops.wm.open_mainfile(filepath=str(other / "later.blend"))
    assert _ended() == ("Wig: trained", True)
    assert Path(model_path(bpy.data.objects["Wig"])).samefile(folder / "Hair_2.neuralocks")


def trained_in_a_shot(folder: Path) -> None:
    """The model of overridden hair is found, even if the hair's own file names one by the same relative path."""
    from dcc_addon.live.models import model_path
    from dcc_addon.operators import training as operator

    library, out = folder / "library", folder / "Hair_1.neuralocks"
    library.mkdir()
    for place in (library, folder):
        shutil.copy(MODEL, place / out.name)
    scenes.hair(scenes.armature(), 20).neuralocks_hair.model = f"//{out.name}"
    bpy.ops.wm.save_as_mainfile(filepath=str(library / "library.blend"))
    scenes.empty()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    with bpy.data.libraries.load(str(library / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Hair"]
    strands = bpy.data.objects["Hair"].override_create()
    assert Path(model_path(strands)).samefile(library / out.name)
    ended = SimpleNamespace(running=False, succeeded=True, out=str(out), cancel=lambda: None, notes=[])
    exported = SimpleNamespace(cleanup=lambda: None)
    operator._running.append(operator._Training(ended, operator._Target.of(strands, "strands"), exported, {}))
    assert _ended() == (f"{strands.name_full}: trained", True)
    assert Path(model_path(strands)).samefile(out)


def _in_training(folder: Path, notes=(), before: str = ""):
    """Hair of a saved file for which a training runs until `_ended` is called; it copies a model, and does something first."""
    stand_in(folder, notes, before)
    scenes.empty()
    rig, strands = scenes.dancer(20, skinned=True)
    bpy.context.scene.neuralocks.armature, bpy.context.scene.neuralocks.hair = rig, strands
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "train.blend"))
    exported = folder / "exported"
    exported.mkdir(exist_ok=True)
    tempfile.tempdir = str(exported)
    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    return strands


def stand_in(folder: Path, notes=(), before: str = "") -> None:
    """From now on, trainings are half done at once, and copy a model when there is a file `go` beside that; they do something first."""
    from dcc_addon.operators import training as operator
    from dcc_addon.services.training import training_job

    (folder / "go").unlink(missing_ok=True)
    child = folder / "child.py"
    child.write_text(
        "import json, pathlib, shutil, sys, time\n"
        "settings = json.load(sys.stdin)\n"
        "assert open(settings['character'], 'rb').read(8) == b'PXR-USDC'\n"
        "print(json.dumps({'done': 0.5, 'message': 'half'}), flush=True)\n"
        f"print(json.dumps({{'notes': {list(notes)!r}}}), flush=True)\n"
        f"{before or 'pass'}\n"
        "go, end = pathlib.Path(settings['out']).with_name('go'), time.monotonic() + 60\n"
        "while not go.exists() and time.monotonic() < end: time.sleep(0.02)\n"
        f"shutil.copy({MODEL!r}, settings['out'])\n"
    )
    check = folder / "check.py"
    check.write_text(f"print({training_job.CAN!r})")
    training_job.CHILD, training_job.CHECK = child, check
    operator.training_python = lambda: shutil.which("python3") or sys.executable


def _ended() -> tuple[str, bool]:
    """The message at the end of the running training, and whether it is good news."""
    from dcc_addon.operators import training as operator
    from dcc_addon.session import session

    Path(operator.job().out).with_name("go").touch()
    end = time.monotonic() + 60
    while operator.finish() is None and time.monotonic() < end:
        time.sleep(0.1)
    assert not messages(), messages()
    return session.said.trained
