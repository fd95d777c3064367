# SPDX-License-Identifier: Apache-2.0
"""The folder beside a model in which its training keeps what it goes on from after a kill."""

import filecmp
import shutil
from pathlib import Path

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write

BEGINNING = "begin.neuralocks"
"""In the work folder: the model that a training begins with."""
CODES = "codes.npz"
"""In the work folder: the strand autoencoder, where a training makes its own."""


def work_folder(out: str | Path, work: str | Path | None = None, resume: bool = False) -> Path:
    """Where a training keeps what it goes on from: asked for before anything is read.

    Raises:
        NeuralocksError: `out` is no name for a model, or there is nothing to resume.
    """
    out = Path(out)
    if out.suffix != ".neuralocks":
        raise NeuralocksError(f"{out}: a model file ends in .neuralocks; choose such a name")
    work = Path(work) if work else out.with_name(out.name + ".training")
    if resume and not any((work / name).exists() for name in ("checkpoint.npz", CODES, BEGINNING)):
        raise NeuralocksError(f"{work}: holds no training to resume; train without --resume")
    return work


def beginning_of(work: Path, begin: str | Path | None, resume: bool) -> Path | None:
    """The model that a training begins with, or that a resumed one began with.

    Raises:
        NeuralocksError: the resumed one did not begin with `begin`.
    """
    if not resume:
        return Path(begin) if begin else None
    kept = work / BEGINNING if (work / BEGINNING).exists() else None
    if begin and not (kept and Path(begin).is_file() and filecmp.cmp(kept, begin, shallow=False)):
        raise NeuralocksError(f"{begin}: the training in {work} did not begin with it; resume without --begin")
    return kept


def keep_beginning(model_file: Path, work: Path) -> None:
    """A copy of the model that is begun with: the training can be resumed whatever happens to the file."""
    with atomic_write(work / BEGINNING) as part:
        shutil.copyfile(model_file, part)


def discard(work: Path) -> None:
    """Remove what trainings leave in a folder, and the folder where nothing else is in it."""
    for name in ("rollouts", "held_out"):
        shutil.rmtree(work / name, ignore_errors=True)
    for name in ("checkpoint", "codes"):
        for suffix in (".npz", ".tmp"):
            (work / name).with_suffix(suffix).unlink(missing_ok=True)
    (work / BEGINNING).unlink(missing_ok=True)
    if work.is_dir() and not any(work.iterdir()):
        work.rmdir()
