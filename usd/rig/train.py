# SPDX-License-Identifier: Apache-2.0
"""`neuralocks rig train`: from a USD rig to a model file."""

from collections.abc import Callable

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.arguments import flag
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, check_writable
from neuralocks_core.models import model_file
from neuralocks_core.models.shortcomings import shortcomings
from neuralocks_core.progress import Progress

from ..border.amounts import check_number
from ..border.command_line import command_line
from ..border.extras import check_training
from .notes import chain_notes, rigged_notes
from .stage import check_patterns, read_rigged_hair
from .warm_start import HIGHEST, LOWEST, Beginning


def train_rig(
    character,
    out,
    *,
    dynamic: bool = True,
    seconds: float | None = None,
    steps: int | None = None,
    hidden: int | None = None,
    clips: int | None = None,
    material: dict | None = None,
    seed: int = 0,
    begin=None,
    chains: list[str] | None = None,
    head: str | None = None,
    skeleton: str | None = None,
    joints: dict[str, str] | None = None,
    early: bool = False,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
):
    """Train a model for the hair joints of a rig and write it.

    Args:
        character: USD file.
        out: `.neuralocks` file to write.
        dynamic: learn lag, swing and settling from a simulation of the chains; otherwise held poses, from the energy alone.
        seconds, steps, hidden, seed: see `training.rig.static.train_static` and `training.rig.dynamic.train_dynamic`, whose
            defaults replace None.
        clips: see the latter.
        material: fields of `rig.rods.RigMaterial`.
        begin: a model file of the same kind and chains to train on, by default with its own material; `hidden` must be left out.
        chains, head, skeleton, joints: see `read_rigged_hair`.
        early: also write the model before its report is measured, which takes minutes: whoever stops that has the model.
        tell: called with notes for the user before training, since some may save its minutes, and at the end with what the report
            says against the model.
        progress: called with (done, total, message).

    Returns:
        the RigModel.

    Raises:
        NeuralocksError: the rig or the model to begin with cannot be used, a number is out of its range, or the extra `train` is
            missing.
    """
    material, dynamic, early = material or {}, flag("dynamic", dynamic), flag("early", early)
    _check_amounts(dynamic, seconds, steps, hidden, clips, seed, material)
    check_training()
    from neuralocks_core.rig.rods import RigMaterial

    character, out = as_path(character, "character"), model_file.named(as_path(out, "out"))
    check_writable(out)
    former = None if begin is None else Beginning(begin, dynamic, hidden)
    hair = read_rigged_hair(character, skeleton=skeleton, head=head, chains=chains, joints=joints, all_shapes=True)
    check_patterns(hair, chains)
    if former:
        former.check(hair.rig.chains)
    notes = rigged_notes(hair.stage_rig) + chain_notes(hair, chains)
    if hair.rig.character.body is None:
        notes.append(
            f"{hair.stage_rig.path}: it skins no body mesh; the hair is trained without anything to collide with"
        )
    if tell:
        tell(notes)
    values = RigMaterial(**(former.material() if former else {}) | material)
    options = {"seconds": seconds, "steps": steps, "hidden": hidden, "begin": former and former.model}
    if dynamic:
        from neuralocks_core.training.rig.dynamic import train_dynamic as train

        options["clips"] = clips
    else:
        from neuralocks_core.training.rig.static import train_static as train
    chosen = {name: value for name, value in options.items() if value is not None}
    written = False

    def write(model) -> None:
        nonlocal written
        model.training.update(_card(hair.stage_rig.character, model, character.name))
        if former:
            model.training["began with"] = former.card()
        if command := command_line():
            model.training["command"] = command
        model.save(out)
        written = True

    try:
        model = train(hair.rig, values, seed=seed, keep=write if early else None, progress=progress, **chosen)
    except KeyboardInterrupt:
        if written and tell:
            tell([f"{out}: is written, but without its report, which was still being measured"])
        raise
    write(model)
    if tell:
        tell(shortcomings(out, "rig", model.report))
    return model


def _card(who: Character, model, name: str) -> dict:
    """What the model's card says about the character that it was trained for."""
    read = {name: who.skeleton.names[who.humanoid.nearest(name)] for name in ("head", *model.spec.pose_joints)}
    return {
        "character": name,
        "facing": round(who.facing_angle, 3),
        "reads": {name: leaf(path) for name, path in read.items()},
    }


def _check_amounts(dynamic: bool, seconds, steps, hidden, clips, seed, material: dict) -> None:
    """Refuse numbers that no training can use; None stands for a default."""
    if not dynamic and (clips is not None or "damping" in material):
        raise NeuralocksError("--clips, --damping: have no effect on held poses; leave out --quasi-static")
    for name, value, low, high, whole in (
        ("seconds", seconds, 1, 86_400, False),
        ("steps", steps, 1, 10_000_000, True),
        ("hidden", hidden, 1, 256, True),
        ("clips", clips, 2, 10_000, True),
        ("seed", seed, 0, 2**32 - 1, True),
        *((name, material.get(name), LOWEST, HIGHEST, False) for name in ("bend", "weight", "damping")),
    ):
        if value is not None:
            check_number(f"--{name}", value, low, high, whole=whole)
