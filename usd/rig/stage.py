# SPDX-License-Identifier: Apache-2.0
"""A stage's rigged mesh hair: which skeleton carries it, its chains, its meshes."""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from glob import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pxr import Usd, UsdSkel

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError, reworded
from neuralocks_core.rig.chain_finding import NoHairChains, fits
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.measuring import UNEVEN, placed_chains
from neuralocks_core.rig.rigging import HairRig, assemble_rig
from neuralocks_core.skinned_body import Body

from ..border.amounts import check_names
from ..border.damage import names_damage
from ..border.prim_paths import prim_path
from ..border.stage_files import open_stage
from ..border.stopping import check
from ..border.units import Border
from ..border.values import as_names
from ..shot.characters.others import Others
from ..shot.characters.whole_body import parts_elsewhere, with_parts
from ..shot.notes.missing import has_hair_joints, nothing_found
from ..shot.notes.skeleton_notes import partial_body
from ..skel.source import find_skeletons, read_rig
from ..skel.stage_rig import StageRig
from ..skel.surface import find_skins
from .uneven import names_uneven_prims

BAKED = "NeuralocksHair"
"""Name of the SkelAnimation that a bake writes."""
_FEW = 4
"""Up to this many prims are named in an error."""


@dataclass(frozen=True)
class RiggedHair:
    """One skeleton of a stage with hair chains.

    Attributes:
        stage: the shot.
        stage_rig: skeleton, body and clip as read.
        rig: hair and body, separated.
        others: other skeletons with hair chains, from which this one was chosen.
        elsewhere: parts of the character that other skeletons skin, on this one's joints.
    """

    stage: Usd.Stage = field(repr=False)
    stage_rig: StageRig = field(repr=False)
    rig: HairRig = field(repr=False)
    others: tuple[str, ...] = ()
    elsewhere: tuple[Body, ...] = field(default=(), repr=False)

    @property
    def path(self) -> str:
        """The Skeleton prim."""
        return self.stage_rig.path


class _Unusable(NamedTuple):
    """Why the hair of a skeleton cannot be read, and whether it is named like hair."""

    path: str
    hairy: bool
    error: NeuralocksError


@names_damage
def read_rigged_hair(path: str | Path, *, baked_first: bool = False, **options) -> RiggedHair:
    """Read the rigged mesh hair of one character of a stage.

    Args:
        path: USD file.
        baked_first: whether a bake is wanted: its hair is what it moves, and of several skeletons with hair chains, the first that a bake
            moves and that skins a mesh that is shown is taken, or the first; otherwise several are refused.
        options: see `read_rigged_hairs`, also for what it raises.

    Raises:
        NeuralocksError: there are several.
    """
    found, _ = read_rigged_hairs(path, as_baked=baked_first, **options)
    if baked_first:
        found.sort(key=lambda hair: (not is_baked(hair.stage_rig), hair.stage_rig.character.body is None))
        found = [replace(found[0], others=tuple(hair.stage_rig.path for hair in found[1:]))]
    if len(found) > 1:
        few = ", ".join(hair.stage_rig.path for hair in found[:_FEW]) + (", ..." if len(found) > _FEW else "")
        raise NeuralocksError(
            f"{path}: {len(found)} skeletons have hair chains ({few}); choose one with --skeleton PRIM"
        )
    check_orients(found[0].stage_rig, found[0].rig.chains)
    return found[0]


@names_damage
def read_rigged_hairs(
    path: str | Path,
    *,
    skeleton: str | None = None,
    head: str | None = None,
    chains: list[str] | None = None,
    joints: dict[str, str] | None = None,
    all_shapes: bool = False,
    cuts: list[float] | None = None,
    unbaked: bool = False,
    as_baked: bool = False,
    model: HairChains | None = None,
) -> tuple[list[RiggedHair], list[NeuralocksError]]:
    """Read the rigged mesh hair of a stage, and why other skeletons with joints that are named like hair cannot be used.

    Args:
        path: USD file.
        skeleton: path of the only Skeleton prim to read.
        head: joint that carries the hair, if it is not named like a head.
        chains: name patterns of the chains' first joints, instead of finding them.
        joints: semantic joint -> joint path or its last part, if names are not enough.
        all_shapes: keep blend shapes that the animation does not use (training draws random ones).
        cuts: as for `stage.read_shot`.
        unbaked: as for `read_rig`.
        as_baked: of a rig bake, the chains that it moves, instead of finding them.
        model: a model's chains, whatever their names here; then nothing is guessed about which joints are hair.

    Raises:
        NoHairChains: there is no joint of the model's chains.
        NeuralocksError: there is no such skeleton, or its hair chains cannot be used; the message names prim or joint.
    """
    check_names("--chains", chains)
    stage, skeleton = open_stage(path), prim_path(skeleton, "skeleton")
    border = Border.of(stage)
    prims = find_skeletons(stage, skeleton)
    if not prims:
        raise nothing_found(stage, Path(path), "Skeleton", "give a stage with a skinned character")
    given = {"all_shapes": all_shapes, "joints": joints, "cuts": cuts, "unbaked": unbaked}
    found, errors, bare, skins = [], [], [], find_skins(stage)
    for prim in prims:
        stage_rig = None
        try:
            check_authored(prim)
            stage_rig = read_rig(stage, prim, border, head, skins=skins, **given)
            with names_uneven_prims(stage_rig):
                wanted = chains or (of_bake(stage_rig) if as_baked else None)
                wanted = wanted if model is None else _of_model(model, stage_rig.character)
                rig = assemble_rig(stage_rig.character, core_meshes(stage_rig), wanted)
            if model is not None:  # otherwise it is checked for the chosen one
                check_orients(stage_rig, rig.chains)
        except NeuralocksError as error:
            check()  # the error may come from a stop by the user
            bare += [] if stage_rig is None else [stage_rig]
            error = reworded(error, _with_path(prim, error))
            errors.append(_Unusable(str(prim.GetPath()), _is_hairy(prim, model), error))
            continue
        found.append(RiggedHair(stage, stage_rig, rig))
    # Hair may have its own skeleton besides the body's; the error should not be that the body's has no hair.
    hairy = [each for each in errors if each.hairy]
    if not found:
        raise (hairy or errors)[0].error from None
    if model is None:
        others = (
            bare if skeleton is None else Others([hair.stage_rig for hair in found], stage, head, joints).maybe_same()
        )
        found = _on_whole_bodies(found, others)
    return found, [of_skeleton(each.path, each.error) for each in hairy]


def _on_whole_bodies(found: list[RiggedHair], others: list[StageRig]) -> list[RiggedHair]:
    """Hair that may touch all meshes of its character, which may be in several skeletons; the hair of these is no body."""
    hairless, result = [replace(hair.stage_rig, character=hair.rig.character) for hair in found], []
    for hair, own in zip(found, hairless):
        parts, left = parts_elsewhere(own, [*hairless, *others])
        hair.stage_rig.notes.extend(partial_body(own, left))
        rig = hair.rig.with_body(with_parts(own.character.body, parts))
        result.append(replace(hair, rig=rig, elsewhere=tuple(parts)))
    return result


def of_skeleton(path: str, error) -> NeuralocksError:
    """What is wrong with one of several skeletons, prefixed with its path."""
    text = str(error)
    return NeuralocksError(text if text.startswith(f"{path}: ") else f"{path}: {text}")


def _is_hairy(prim: Usd.Prim, model: HairChains | None) -> bool:
    """Whether joints of a Skeleton are named like hair, or like those of a model."""
    joints = UsdSkel.Skeleton(prim).GetJointsAttr()
    with suppress(NeuralocksError):  # errors in them are reported when the skeleton is read
        names = () if model is None else as_names(joints, joints.Get())
        return has_hair_joints(prim) or any(leaf(name) in model.names for name in names)
    return False


def _of_model(model: HairChains, character: Character) -> HairChains:
    """A model's chains in a character, by the names that they have there."""
    names, below = character.skeleton.names, character.of_head
    chains = model.named_as(names, below)
    if not {leaf(name) for name in names} & set(chains.names):
        raise NoHairChains(
            f"no joint of the model's {len(model.roots)} hair chains ({model.tops[0]}, ...) is in it; give a model trained for this "
            "rig (neuralocks rig train)"
        )
    return placed_chains(chains, character)


def of_bake(stage_rig: StageRig) -> list[str] | None:
    """Patterns for the joints that a rig bake moves; None if it is no bake, or one of a rig with other joints."""
    hair, names = set(stage_rig.joints.baked_hair), stage_rig.joints.names
    if not hair or not hair <= set(names):
        return None
    return [escape(name) for name in names if name in hair]


def is_baked(stage_rig: StageRig) -> bool:
    """Whether the animation of a skeleton is one that `rig bake` wrote."""
    animation = stage_rig.joints.animation
    return animation is not None and animation.GetName() == BAKED


def core_meshes(stage_rig: StageRig) -> list[Body]:
    """The skinned meshes of a skeleton in the core's axes and metres, in the order of the merged body."""
    return [Body(*mesh.in_bind(stage_rig.to_bind), mesh.indices, mesh.weights) for mesh in stage_rig.meshes]


def check_patterns(hair: RiggedHair, patterns: list[str] | None) -> None:
    """Refuse a pattern of `--chains` that matches none of the joints found, nor an offset that carries some.

    Raises:
        NeuralocksError: names it.
    """
    character, joints = hair.stage_rig.character, hair.rig.chains.joints
    above = [j for j in np.flatnonzero(character.of_head) if character.skeleton.below(j)[joints].any()]
    for pattern in patterns or ():
        if not any(fits(hair.stage_rig.joints.names[joint], pattern) for joint in above):
            raise NeuralocksError(
                f"--chains {pattern}: no joint of the hair has such a name; see neuralocks inspect for their names"
            )


def check_authored(prim: Usd.Prim) -> None:
    """A rest pose is no stand-in for a bind pose here: hair would take the pose that a rig happens to rest in for its shape.

    Raises:
        NeuralocksError: a skeleton with joints has no bindTransforms.
    """
    skeleton = UsdSkel.Skeleton(prim)
    joints, bind = skeleton.GetJointsAttr().Get(), skeleton.GetBindTransformsAttr().Get()
    if joints and not bind:
        raise NeuralocksError(f"{prim.GetPath()}: it has no bindTransforms; export the skeleton with its bind pose")


def check_orients(stage_rig: StageRig, chains: HairChains) -> None:
    """The core works on orients without scale and mirroring; joint rotations can only be written if orients are not mirrored.

    Raises:
        NeuralocksError: names the joint.
    """
    bind, names = stage_rig.joints.bind, stage_rig.joints.names
    for joint in np.unique(np.concatenate([chains.joints, np.maximum(stage_rig.joints.parents[chains.joints], 0)])):
        linear = bind[joint, :3, :3]
        name = leaf(names[joint])
        if np.linalg.det(linear) * np.linalg.det(bind[stage_rig.character.head, :3, :3]) < 0:
            raise NeuralocksError(
                f"{stage_rig.path}: joint '{name}' is mirrored in bind pose (negative scale); apply the scale in the rig"
            )
        scale = np.linalg.norm(linear, axis=0)
        if scale.max() > UNEVEN * scale.min():
            raise NeuralocksError(
                f"{stage_rig.path}: joint '{name}' is unevenly scaled in bind pose; apply the scale in the rig"
            )


def _with_path(prim: Usd.Prim, error: Exception) -> str:
    text, path = str(error), str(prim.GetPath())
    return text if text.startswith((path, "--", "model")) else f"{path}: {text.removeprefix('skeleton: ')}"


def describe_chains(chains: HairChains) -> list[dict]:
    """Name, number of moving joints and length of every chain."""
    return [
        {
            "name": chains.chain_name(i),
            "joints": int((chains.chain == i).sum()),
            "length [m]": round(chains.chain_length(i), 5),
        }
        for i in range(len(chains.roots))
    ]
