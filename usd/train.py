# SPDX-License-Identifier: Apache-2.0
"""`neuralocks train`: from files to a model file."""

import shlex
import sys
from pathlib import Path

from neuralocks_core.errors import NeuralocksError


def train(
    character,
    grooms,
    motion,
    out,
    settings: dict,
    *,
    skeleton: str | None = None,
    head: str | None = None,
    resume: bool = False,
    rollouts: int = 1200,
    processes: int = 1,
    credits=(),
    keep_work: bool = False,
    progress=None,
) -> Path:
    """Train a strand model.

    Args:
        character: USD file.
        grooms: USD files, or "library".
        motion: BVH or USD files.
        out: `.neuralocks` file to write.
        settings: fields of `training.regression.RegressionOptions`.
        skeleton, head: as for `bake`.
        resume: go on with an interrupted training.
        rollouts, processes: how many simulations, made by how many processes.
        credits: lines for the model card.
        keep_work: leave the simulations and the checkpoint beside the model.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: a file cannot be used, or the extra `train` is missing.
    """
    try:
        import torch
        import warp  # noqa: F401  (the solver's)
    except ImportError as error:
        raise NeuralocksError(f"train: {error.name} is not installed; pip install 'neuralocks[train]'") from None
    if settings.get("device") == "cuda" and not torch.cuda.is_available():
        raise NeuralocksError("--device cuda: this machine has no CUDA device; use --device cpu")
    from neuralocks_core.training.regression import RegressionOptions
    from neuralocks_core.training.train import train_strands

    from .training import training_scene

    scene = training_scene(character, grooms, motion, skeleton=skeleton, head=head, seed=settings.get("seed", 0))
    command = shlex.join(["neuralocks", *sys.argv[1:]]) if Path(sys.argv[0]).name.startswith("neuralocks") else ""
    return train_strands(
        scene, out, RegressionOptions(**settings), rollouts=rollouts, processes=processes, resume=resume,
        credits=tuple(credits), command=command, keep_work=keep_work, progress=progress,
    )  # fmt: skip
