# SPDX-License-Identifier: Apache-2.0
"""Bake rigged mesh hair: one SkelAnimation in an override layer, the body's joints as they were, the hair's from
the network.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import UsdSkel

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.progress import Progress
from neuralocks_core.rig.carried import CarriedHair
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.network import RigModel
from neuralocks_core.shortcomings import shortcomings

from ..border.amounts import check_number
from ..border.damage import names_damage
from ..border.stage_files import check_layer_name, check_not_input
from ..border.time_codes import given_cuts, time_codes
from ..shot.notes import asked_notes, on_twos, out_of_place, without_turn
from ..shot.stage import check_cuts, frame_range
from .layer import kept_hair, write_rig_layer
from .stage import RiggedHair, mirrored_notes, read_rigged_hair, rigged_notes

STILL = 1e-4
"""A rotation that differs by less from none is none."""


@dataclass(frozen=True)
class RigBakeResult:
    """What a rig bake wrote.

    Attributes:
        path: the override layer.
        skeleton: the Skeleton prim.
        animation: the new SkelAnimation prim.
        joints: how many hair joints move.
        samples: how many time codes the rotations are written at.
        notes: what a user should know.
    """

    path: Path
    skeleton: str
    animation: str
    joints: int
    samples: int
    notes: list[str]


@names_damage
def bake_rig(
    shot,
    out,
    model=None,
    *,
    skeleton: str | None = None,
    head: str | None = None,
    frames=None,
    subframes: int = 1,
    loop: bool = False,
    strength: float = 1.0,
    cuts=None,
    joints: dict[str, str] | None = None,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> RigBakeResult:
    """Bake the hair joints of a shot.

    Every sample is a function of the motion around it alone, so that order, ranges and rates cannot change it.

    Args:
        shot: USD file with a skinned character, hair chains and an animation.
        out: override layer to write, .usd, .usda or .usdc; muting it gives the shot back.
        model: model file or RigModel; the shipped one if left out.
        skeleton: Skeleton prim, where several have hair.
        head: joint that carries the hair.
        frames: as `time_codes.time_codes` takes them; the animation's own samples are always among those written.
        subframes: samples a frame.
        loop: the clip repeats, its last sample shows the pose of its first.
        strength: motion strength of a dynamic model, from 0 to 2; 1 is as trained.
        cuts: time codes from which the character is elsewhere and its hair starts anew; found by itself if None.
        joints: semantic joint -> joint (path, or its last part), where names do not tell.
        tell: called with the notes that are known before hair is turned, then with the others.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: shot, model or output cannot be used.
    """
    out, shot = as_path(out, "out"), as_path(shot, "shot")
    check_layer_name(out)
    check_number("--strength", strength, 0, 2)
    model = model if isinstance(model, RigModel) else RigModel.load(model)
    cuts = given_cuts(cuts, loop)
    trained = model.chains
    hair, model, moved, size = _read(shot, skeleton, head, model, cuts, joints)
    source = hair.source.source
    check_not_input(out, hair.stage)
    if stops := without_turn(hair.source, model.spec.pose_joints):
        raise NeuralocksError(stops[0])
    wanted = time_codes(frames, *frame_range(hair.stage, [hair.source]), subframes, hair.border.frame)
    codes = _with_samples(hair, moved, wanted)
    clip = replace(hair.source.clip, loop=True) if loop else hair.source.clip
    carried = CarriedHair(model, moved, hair.source.character, clip)
    notes = [
        *shortcomings("model", "rig", model.report),
        *_renamed(trained, model.chains),
        *_resized(source.path, size),
    ]
    notes += _known(hair, moved, wanted, model, loop, cuts is None)
    if strength != 1 and not model.dynamic:
        notes.append("motion strength: has no effect on a model of held poses; leave it at 1, or give a dynamic model")
    if tell:
        tell(notes)
    turns = hair.source.authored_turns(moved, _turns(hair, carried, clip, codes, strength, progress))
    late = _held(hair, carried.carriers, turns)
    animation = write_rig_layer(hair, moved, shot, out, codes, turns)
    late += [note for note in hair.source.notes if note not in notes]  # of poses between those of the clip
    late += out_of_place(hair.stage, out)
    if tell:
        tell(late)
    return RigBakeResult(out, source.path, animation, len(model.chains), len(codes), notes + late)


def _known(
    hair: RiggedHair, moved: np.ndarray, wanted: list[float], model: RigModel, loop: bool, find_cuts: bool
) -> list[str]:
    """What a user should know before joints `moved` (N,) are turned at time codes."""
    rig, read = hair.source, model.spec.pose_joints
    return [
        *rigged_notes(rig, read),
        *_name_notes(rig.source),
        *mirrored_notes(rig, hair.rig.chains),
        *(rig.loop_notes(wanted, moved) if loop else []),
        *(on_twos(rig, read) if model.dynamic else []),
        *(rig.cut_notes(loop) if (loop or find_cuts) and model.dynamic else []),
        *asked_notes(hair.stage, [rig], wanted),
    ]


def _read(shot, skeleton, head, model: RigModel, cuts, joints) -> tuple[RiggedHair, RigModel, np.ndarray, float]:
    """The shot, the model with the shot's names of its joints, where these are in the skeleton (N,), and how many times as
    large as the model's rig it is.
    """
    hair = read_rigged_hair(
        shot, skeleton=skeleton, head=head, joints=joints, cuts=cuts, unbaked=True, model=model.chains
    )
    here = hair.rig.chains
    if here.names != model.chains.names:
        model = replace(model, chains=replace(model.chains, names=here.names))
    size = model.chains.check_same(here)
    check_cuts(cuts, [hair.source])
    return hair, model, here.joints, size


def _held(hair: RiggedHair, carriers: np.ndarray, turns: np.ndarray) -> list[str]:
    """The note on a head that is held still, with all else that carries hair.

    Raises:
        NeuralocksError: it is held as it was bound, so that no hair would move; or USD ignores its animation.
    """
    source, character, joints = hair.source.source, hair.source.character, hair.source.clip.joints
    if np.ptp(joints[:, carriers], axis=0).max() >= 1e-7:
        return []
    if source.ignored:
        raise NeuralocksError(source.ignored)
    name = leaf(character.skeleton.names[character.head])
    turned = np.abs((joints[0, carriers] @ character.inverse_bind[carriers])[:, :3, :3] - np.eye(3)).max()
    if min(turned, np.abs(turns[..., 1:]).max()) < STILL:
        raise NeuralocksError(
            f"{hair.source.path}: its head joint '{name}' is not animated, so the hair would not move; "
            "animate the skeleton, or name the joint that carries the hair with --head JOINT"
        )
    return [f"{hair.source.path}: its head joint '{name}' does not move, so the hair is that of a held pose"]


def _renamed(trained: HairChains, here: HairChains) -> list[str]:
    """The note on joints that are called otherwise than in the rig that the model was trained for."""
    if here is trained:
        return []
    return [f"model: its joints have other names here, '{here.names[0]}' for '{trained.names[0]}'"]


def _resized(path: str, size: float) -> list[str]:
    """The note on a character of another size than the model's."""
    if size == 1:
        return []
    return [
        f"{path}: is {size:.2f} times as large as the character that the model was trained for; its hair swings as fast as that "
        "one's"
    ]


def _with_samples(hair: RiggedHair, moved: np.ndarray, wanted: list[float]) -> list[float]:
    """What was asked for and the animation's own samples: the body must come out sample for sample."""
    own = _rotation_samples(hair, moved)
    # A frame and a sample at the same time, up to rounding, are one.
    edges = np.array([-np.inf, *own, np.inf])
    after = np.searchsorted(edges, wanted)
    near = np.minimum(edges[after] - wanted, wanted - edges[after - 1]) <= 1e-6 * hair.border.frame
    return sorted({*np.array(wanted)[~near].tolist(), *own})


def _rotation_samples(hair: RiggedHair, moved: np.ndarray) -> list[float]:
    source = hair.source.source
    read = [source.animation] + [source.copied] * bool(kept_hair(source, moved))
    attributes = [UsdSkel.Animation(prim).GetRotationsAttr() for prim in read if prim]
    return sorted({code for attribute in attributes for code in attribute.GetTimeSamples()})


def _turns(hair, carried, clip, codes, strength, progress) -> np.ndarray:
    """Turns of the hair joints (T, N, 4) wxyz in their own bind axes, those of the shot's rig as read."""
    chains = carried.model.chains
    turns = np.empty((len(codes), len(chains), 4))
    for row, code in enumerate(codes):
        # One at a time: a matrix product may round otherwise for other batches.
        second = hair.border.seconds([code])
        wrapped = clip.loop and not clip.start <= second[0] <= clip.end
        shown = clip.at(second) if wrapped else hair.source.joints_at(code)[None]
        turns[row] = carried.turns(second, strength, shown)[0]
        if progress:
            progress(row + 1, len(codes), "hair joints")
    return chains.turns_on(hair.rig.chains, turns)


def _name_notes(source) -> list[str]:
    """Blender names a bone after the last part of its joint's path, and cuts that at 63 bytes."""
    leaves = [leaf(name) for name in source.names]
    long = next((n for n in leaves if len(n.encode()) > 63), None)
    if long:
        return [f"{source.path}: the name of joint '{long}' has more than 63 bytes in UTF-8; Blender cuts it"]
    double = next((n for n in leaves if leaves.count(n) > 1), None)
    if double:
        return [f"{source.path}: several joints are named '{double}'; Blender renames all but one"]
    return []
