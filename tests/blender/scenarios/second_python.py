# SPDX-License-Identifier: GPL-3.0-or-later
"""The second Python that trains: the panel notices when it can, and a model comes of it."""

import shutil
import sys
import time
from pathlib import Path
from unittest import SkipTest

import bpy

from tests.blender import scenes
from tests.blender.checks import messages


def remedy_followed(folder: Path) -> None:
    """The panel notices automatically that a Python that could not train now has what it lacked."""
    from dcc_addon.operators import training as operator
    from dcc_addon.services.training import trainers, training_job

    there, check = folder / "torch", folder / "check.py"
    check.write_text(
        f"import os, sys\nos.path.exists({str(there)!r}) or sys.exit('it lacks torch')\nprint({training_job.CAN!r})"
    )
    python = shutil.which("python3") or sys.executable
    kept = training_job.CHECK, operator.training_python, trainers.AGAIN, operator._trainers
    training_job.CHECK, operator.training_python, trainers.AGAIN = check, lambda: python, 0.5
    operator._trainers = trainers.Trainers()
    try:
        assert operator.known_problem() is None and bpy.app.timers.is_registered(operator.await_answer)
        assert "it lacks torch" in _told(lambda said: said is not None)
        there.touch()
        assert not _told(lambda said: not said)
    finally:
        training_job.CHECK, operator.training_python, trainers.AGAIN, operator._trainers = kept


def _told(until) -> str:
    """What the panel says when it fits, redrawn only after each answer."""
    from dcc_addon.operators import training as operator

    end = time.monotonic() + 60
    while not until(said := operator.known_problem()) and time.monotonic() < end:
        while operator.await_answer() is not None and time.monotonic() < end:
            time.sleep(0.05)
    return said


def trained_for_real(folder: Path) -> None:
    """Train from the panel's own operator in a real second Python, with progress, cancel, and a model at the end."""
    from dcc_addon.operators import training as operator
    from dcc_addon.services.training.training_job import problem
    from dcc_addon.session import session

    trouble = problem(operator.training_python())
    if trouble:
        raise SkipTest(trouble)
    rig, strands = scenes.dancer(40, skinned=True)
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    scene.neuralocks.train_minutes = 0.05
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "train.blend"))

    def wait(until, seconds):
        end = time.monotonic() + seconds
        while not until():
            assert time.monotonic() < end, operator.job() and (operator.job().message, operator.job().failure())
            time.sleep(0.2)

    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    running = operator.job()
    wait(lambda: running.message not in ("Starting",), 120)
    assert bpy.ops.neuralocks.cancel_training() == {"FINISHED"}
    assert operator.job() is None and not running.running and not running.succeeded
    assert not list(folder.glob("*.neuralocks")), "a cancelled training leaves no model"

    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    running, said, shares = operator.job(), set(), []

    def follow():
        said.add(running.message)
        shares.append(running.done)
        return operator.finish() is not None

    wait(follow, 400)
    print(sorted(said))
    assert session.said.trained == ("Hair: trained", True)
    assert len(said) > 3 and shares == sorted(shares)
    assert Path(bpy.path.abspath(strands.neuralocks_hair.model)).samefile(folder / "Hair_1.neuralocks")
    strands.neuralocks_hair.live = True
    scene.frame_set(9)
    assert "Hair" not in messages(), messages()
    assert "neuralocks_rest" in strands.data.attributes
