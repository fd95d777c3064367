# SPDX-License-Identifier: Apache-2.0
"""`neuralocks train`: from files to a model file."""

import dataclasses
import enum
import math
from collections.abc import Callable
from pathlib import Path

from neuralocks_core.arguments import flag
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.deformation.model_choice import nearest_to_all
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, check_writable
from neuralocks_core.models import model_file
from neuralocks_core.number_words import plain_number
from neuralocks_core.progress import Progress

from ..border.command_line import command_line
from ..border.extras import check_training

METHODS = ("rollouts", "selfsupervised")
SHIPPED, NOTHING = "shipped", "nothing"
"""Words for what a training begins with: the shipped model that knows such hair best, or random weights."""


def train(
    character,
    grooms,
    motion,
    out,
    settings: dict,
    *,
    method: str = "rollouts",
    paper: bool = False,
    skeleton: str | None = None,
    head: str | None = None,
    joints: dict[str, str] | None = None,
    begin: str | Path | None = None,
    resume: bool = False,
    variations: int = 0,
    gestures: dict[str, float] | None = None,
    rollouts: int = 4000,
    processes: int = 1,
    credits=(),
    keep_work: bool = False,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Train a strand model.

    Args:
        character: USD file.
        grooms: USD files, names of styles of the library (`neuralocks_core.hairstyles.STYLES`), or "library" for all of these.
        motion: BVH or USD files.
        out: `.neuralocks` file to write.
        settings: fields of `RegressionOptions` or `SelfSupervisedOptions` (`training.learning.regression_options`, `moment_options`);
            values may be words.
        method: "rollouts" of the solver, or "selfsupervised" as in the paper.
        paper: with "selfsupervised", use what the paper states, including its boundary history, unless `settings` say otherwise.
        skeleton, head, joints: as for `bake`.
        begin: a model to start from, "shipped" for the shipped one that knows such hair best, or "nothing"; if left out,
            "shipped" where it has the same method, network and inputs.
        resume: continue an interrupted training.
        variations: of each style of the library, besides the style itself; 50 at most.
        gestures: how often generated motion has each kind of gesture, relative to the others: {"bow": 3}.
        rollouts, processes: how many simulations, made by how many processes.
        credits: lines for the model card.
        keep_work: leave the simulations and the checkpoint beside the model.
        tell: called with notes for the user: most of them before training, since some may save its minutes, and the last ones on
            what it has learned.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: a file cannot be used, a setting is unknown, or the extra `train` is missing.
    """
    if method not in METHODS:
        raise NeuralocksError(f"--method {method}: is unknown; choose one of {', '.join(METHODS)}")
    paper, resume, keep_work = flag("--paper", paper), flag("--resume", resume), flag("--keep-work", keep_work)
    if paper and method != "selfsupervised":
        raise NeuralocksError("--paper: goes with --method selfsupervised only; add it, or leave --paper out")
    check_training()
    import torch

    from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
    from neuralocks_core.training.learning.regression_options import RegressionOptions
    from neuralocks_core.training.learning.selfsupervised import paper_boundary
    from neuralocks_core.training.option_checks import check_options
    from neuralocks_core.training.train import train_strands
    from neuralocks_core.training.work_folder import BEGINNING, work_folder

    from .training_scene import training_scene

    of_method = RegressionOptions if method == "rollouts" else SelfSupervisedOptions
    values = parsed(of_method, settings)
    options = of_method.paper(**values) if paper else of_method(**values)
    check_options(options, rollouts, processes)
    try:
        torch.empty(0, device=options.device)
    except (RuntimeError, AssertionError):  # the latter if torch was built without CUDA
        raise NeuralocksError(f"--device {options.device}: this machine has no such device; use cpu") from None
    out = as_path(out, "out")
    check_writable(out)
    history = {"spec": paper_boundary()} if paper else {}
    work = work_folder(out, resume)
    if begin == NOTHING and resume and (work / BEGINNING).exists():
        raise NeuralocksError(f"--begin {NOTHING}: the training in {work} began with a model; resume without --begin")
    checked = begins_with(begin, resume, history.get("spec", BoundarySpec()), options)
    scene = training_scene(
        character, grooms, motion, skeleton=skeleton, head=head, joints=joints, seed=options.seed,
        variations=variations, tell=tell, progress=progress, gestures=gestures, **history,
    )  # fmt: skip
    suited = nearest_to_all(scene.grooms) if checked and begin in (None, SHIPPED) else None
    if suited and tell and (hair := model_file.kind_known(suited)):
        tell([f"training begins with the shipped model for {hair} hair, which knows such hair best"])
    path = train_strands(
        scene, out, options, rollouts=rollouts, processes=processes, begin=suited or checked, resume=resume,
        credits=tuple(credits), command=command_line(), keep_work=keep_work, tell=tell, progress=progress,
    )  # fmt: skip
    if tell:
        tell(model_file.read(path).shortcomings())
    return path


def begins_with(begin: str | Path | None, resume: bool, spec: BoundarySpec, options) -> Path | None:
    """The model that a training begins with, checked before anything large is read.

    Raises:
        NeuralocksError: the file named is not a model, or differs from what is trained.
    """
    from neuralocks_core.training.learning.regression_options import RegressionOptions
    from neuralocks_core.training.warm_start import Beginning

    if begin == NOTHING or (begin is None and (resume or not isinstance(options, RegressionOptions))):
        return None
    if begin not in (None, SHIPPED) and not Path(begin).exists():
        raise NeuralocksError(f"{begin}: no such model file; name another, '{SHIPPED}' or '{NOTHING}'")
    beginning = Beginning(model_file.shipped() if begin in (None, SHIPPED) else begin)
    if begin is None and beginning.differences(spec, options):
        return None
    beginning.check(spec, options, resume)
    return beginning.path


def parsed(kind: type, settings: dict) -> dict:
    """Settings with words turned into what the fields of a dataclass hold.

    Raises:
        NeuralocksError: a name is not a field, or a word is not a value for it.
    """
    fields = {field.name: field for field in dataclasses.fields(kind)}
    result = {}
    for name, value in settings.items():
        if name not in fields:
            raise NeuralocksError(f"--set {name}: is not an option of this method; it has {', '.join(sorted(fields))}")
        result[name] = _value(name, value, fields[name].default) if isinstance(value, str) else value
    return result


def _value(name: str, word: str, default):
    """A word as a value of the default's kind."""
    try:
        if isinstance(default, bool):
            return {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}[word.lower()]
        if isinstance(default, enum.Enum):
            return {member.name.lower(): member for member in type(default)}[word.lower()]
        if isinstance(default, tuple):
            return tuple(map(_finite, word.split(",")))
        if default is None or isinstance(default, int):
            return plain_number(word, int)
        if isinstance(default, float):
            return _finite(word)
    except (KeyError, ValueError):
        wanted = "a whole number" if default is None else f"something like {default}"
        if isinstance(default, tuple):
            wanted = f"numbers with commas between them, like {','.join(map(str, default))},1.0"
        if isinstance(default, enum.Enum):
            wanted = "|".join(m.name.lower() for m in type(default))
        raise NeuralocksError(f"--set {name}={word}: is not a value for it; give {wanted}") from None
    return word


def _finite(word: str) -> float:
    """The number that a word states; ValueError if it is none, or not finite."""
    number = plain_number(word)
    if not math.isfinite(number):
        raise ValueError
    return number
