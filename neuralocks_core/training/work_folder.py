# SPDX-License-Identifier: Apache-2.0
"""The folder beside a model where its training keeps what it needs to resume after a kill."""

from __future__ import annotations

import filecmp
import hashlib
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write, cannot_write
from neuralocks_core.lock_file import FolderLock
from neuralocks_core.models import model_file

if TYPE_CHECKING:  # cleaning up after a training needs no solver
    from neuralocks_core.training.data.rollouts import TrainingScene

BEGINNING = "begin.neuralocks"
"""In the work folder: the model that a training starts from."""
CODES = "codes.npz"
"""In the work folder: the strand autoencoder, if a training makes its own."""
INPUTS = "inputs.json"
"""In the work folder: what its simulations were made from."""
BEFORE = {"integrator": "implicit Euler", "material": "as it is", "gesture": {}, "share of stops": 0}
"""What simulations were made with if INPUTS lack one of these names."""


def work_folder(out: str | Path, resume: bool) -> Path:
    """The folder of a training, checked before anything is read from it.

    Raises:
        NeuralocksError: `out` is not a name for a model, or there is nothing to resume.
    """
    work = folder_beside(model_file.named(out))
    if resume and not any((work / name).exists() for name in ("checkpoint.npz", CODES, BEGINNING, INPUTS)):
        raise NeuralocksError(f"{work}: holds no training to resume; train without --resume")
    return work


def folder_beside(out: Path) -> Path:
    """The folder in which this model's training works."""
    return out.with_name(out.name + ".training")


def reserve(out: Path) -> bool:
    """Create this folder for a training that will start soon and write a new model, so that no other training takes its name. It is
    removed by `abandon`, or as the training ends. False if the name is taken.

    Raises:
        NeuralocksError: the folder cannot be made.
    """
    work = folder_beside(out)
    try:
        work.mkdir()
        if out.exists():  # checked now: another training may just have ended
            work.rmdir()
            return False
    except FileExistsError:
        return False
    except OSError as error:
        raise cannot_write(work, error) from None
    return True


def abandon(out: str | Path) -> None:
    """Remove what an ended training that nobody will resume has left beside its model, which may be gigabytes; a folder in which
    another training is running stays.
    """
    work = folder_beside(Path(out))
    with suppress(NeuralocksError, OSError):
        if work.exists():
            with claimed(work):
                discard(work)


def beginning_of(work: Path, begin: str | Path | None, resume: bool) -> Path | None:
    """The model that a training starts from, or that a resumed one started from.

    Raises:
        NeuralocksError: the resumed one did not start from `begin`, or its own codes in place of a model are lost.
    """
    if not resume:
        return Path(begin) if begin else None
    kept = work / BEGINNING if (work / BEGINNING).exists() else None
    if begin and not (kept and Path(begin).is_file() and filecmp.cmp(kept, begin, shallow=False)):
        raise NeuralocksError(f"{begin}: the training in {work} did not begin with it; resume without --begin")
    if kept is None and (work / "checkpoint.npz").exists() and not (work / CODES).exists():
        # Its network would continue with strand codes that mean something else to it.
        raise NeuralocksError(f"{work}: lacks {CODES}, with which its network reads strands; train without --resume")
    return kept


def keep_beginning(model_file: Path, work: Path) -> None:
    """Copy the model that a training starts from, so that it can be resumed whatever happens to the file."""
    with atomic_write(work / BEGINNING) as part:
        shutil.copyfile(model_file, part)


@contextmanager
def claimed(work: Path) -> Iterator[None]:
    """Lock the folder for one training: two would learn from each other's simulations.

    Raises:
        NeuralocksError: another training is running in it, or it cannot be made.
    """
    lock = FolderLock(work, work, "another training is running there; wait for it, or choose another name")
    try:
        yield
    finally:
        lock.release()


def keep_inputs(scene: TrainingScene, work: Path, resume: bool) -> None:
    """Record what simulations are made from, and refuse to continue with those of another scene.

    Raises:
        NeuralocksError: those in the folder were made from something else.
    """
    file, now = work / INPUTS, _inputs(scene)
    if resume and file.exists():
        try:
            before = BEFORE | json.loads(file.read_text("utf-8"))
            changed = [name for name in now if before[name] != now[name]]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            raise NeuralocksError(f"{file}: cannot be read; train without --resume") from None
        if "seed" in changed:
            raise NeuralocksError(f"{work}: the training there began with --seed {before['seed']}; resume with that")
        if changed:
            raise NeuralocksError(
                f"{work}: the training there began with a different {changed[0]}; resume with the same, or train "
                "without --resume"
            )
    with atomic_write(file) as part:
        part.write_text(json.dumps(now), "utf-8")


def _inputs(scene: TrainingScene) -> dict:
    from neuralocks_core.reference.solver import INTEGRATOR
    from neuralocks_core.training.data.rollouts import STOPS

    character, clips = scene.character, scene.clips
    body, skeleton = character.body, character.skeleton
    own = (
        []
        if body is None
        else [body.points, body.triangles, body.joint_indices, body.joint_weights, *body.shapes.values()]
    )
    facts = {
        "seed": scene.seed,
        "character": _digest(
            [
                skeleton.bind,
                skeleton.parents,
                np.array(sorted(character.humanoid.items())),
                np.array(character.carrying_joint),
                *own,
            ]
        ),
        "groom": _digest([groom.rest for groom in scene.grooms]),
        "gesture": scene.gestures,
        "share of stops": STOPS,
        "motion": _digest([array for clip in clips for array in (clip.times, clip.joints, clip.shape)]),
        "history": scene.spec.to_json(),
        "integrator": INTEGRATOR,
        "material": "at weight 1",
    }
    return json.loads(json.dumps(facts))  # tuples become lists, as in the file


def _digest(arrays: list[np.ndarray]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.shape} {array.dtype}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def discard(work: Path) -> None:
    """Remove what trainings leave in a folder; `claimed` removes the folder if nothing else is in it."""
    for name in ("rollouts", "held_out"):
        shutil.rmtree(work / name, ignore_errors=True)
    for name in ("checkpoint", "codes"):
        for file in (work / f"{name}.npz", *work.glob(f"{name}.*tmp")):
            file.unlink(missing_ok=True)
    for name in (BEGINNING, INPUTS):
        (work / name).unlink(missing_ok=True)
