# SPDX-License-Identifier: Apache-2.0
"""`neuralocks rig train`: from a USD rig to a model file."""

from pathlib import Path

from neuralocks_core.errors import NeuralocksError

from .rig_stage import read_rigged_hair, weight_notes


def train_rig(
    character,
    out,
    *,
    dynamic: bool = False,
    seconds: float = 75.0,
    steps: int | None = None,
    hidden: int | None = None,
    clips: int = 96,
    material: dict | None = None,
    seed: int = 0,
    chains: list[str] | None = None,
    head: str | None = None,
    skeleton: str | None = None,
    command: str = "",
    progress=None,
):
    """Train a model for the hair joints of a rig and write it.

    Args:
        character: USD file.
        out: `.neuralocks` file to write.
        dynamic: learn from a simulation of the chains instead of the energy alone.
        seconds, steps, hidden, seed: see `training.rig.train_static`.
        clips: see `training.rig_dynamic.train_dynamic`.
        material: fields of `training.rig_energy.RigMaterial`.
        chains, head, skeleton: see `read_rigged_hair`.
        command: for the model card.
        progress: called with (done, total, message).

    Returns:
        the RigModel and notes for the user.

    Raises:
        NeuralocksError: the rig cannot be used, or the extra `train` is missing.
    """
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise NeuralocksError(f"train: {error.name} is not installed; pip install 'neuralocks[train]'") from None
    from neuralocks_core.training.rig_energy import RigMaterial

    hair = read_rigged_hair(character, skeleton=skeleton, head=head, chains=chains, all_shapes=True)
    notes = weight_notes(hair.source)
    if hair.rig.character.body is None:
        notes.append(f"{hair.source.path}: it skins no body mesh; the hair is trained without anything to collide with")
    values = RigMaterial(**(material or {}))
    options = {"seconds": seconds, "steps": steps, "seed": seed, "progress": progress}
    if dynamic:
        from neuralocks_core.training.rig_dynamic import train_dynamic

        model = train_dynamic(hair.rig, values, hidden=hidden or 32, clips=clips, **options)
    else:
        from neuralocks_core.training.rig import train_static

        model = train_static(hair.rig, values, hidden=hidden or 16, **options)
    if command:
        model.training["command"] = command
    model.training["character"] = Path(character).name
    model.save(out)
    return model, notes
