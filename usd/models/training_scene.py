# SPDX-License-Identifier: Apache-2.0
"""What `neuralocks train` learns from: a character, grooms and motion, read from files."""

from collections.abc import Callable
from pathlib import Path

from pxr import Usd

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.animation.random_motion import check_weights
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.groom import Groom
from neuralocks_core.hairstyles import STYLES
from neuralocks_core.progress import Progress, silent
from neuralocks_core.strands.strand_set import StrandSet, strands_on
from neuralocks_core.training.data.rollouts import LEAST, TrainingScene

from ..assets.grow import Barber
from ..border.damage import names_damage
from ..border.placement import Placement
from ..border.stage_files import check_file, open_stage
from ..border.told_once import few
from ..shot.carriers.attach import attach, of_another
from ..shot.carriers.twin_bodies import one_person
from ..shot.characters.skeletons import read_each_rig
from ..shot.notes.skeleton_notes import first_of, unfound, unlikely_head
from ..shot.search.rig_controls import open_curves
from ..shot.stage import read_rigs
from ..shot.strands.curve_ends import groom_between
from ..shot.strands.curves import find_curves, without_points
from ..skel.binding import bound_skeleton
from ..skel.source import find_skeletons
from ..skel.stage_rig import StageRig
from .clip_file import read_clip

LIBRARY = "library"
"""A groom of this name stands for every style of the procedural library, grown on the character."""
MOST_STRANDS = 3000
"""Strands of a groom that are learned from, as in the paper; the network deforms all of them afterwards."""

MOST_VARIATIONS = 50
"""Of each style, besides the style itself: all of their strands are in memory together."""


def training_scene(
    character: str | Path,
    grooms: list[str] | tuple[str, ...] = (),
    motion: list[str] | tuple[str, ...] = (),
    *,
    skeleton: str | None = None,
    head: str | None = None,
    joints: dict[str, str] | None = None,
    seed: int = 0,
    variations: int = 0,
    gestures: dict[str, float] | None = None,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
    **settings,
) -> TrainingScene:
    """Read a character, its grooms and motion for training.

    Args:
        character: a USD file with a skeleton and skinned meshes.
        grooms: USD files with BasisCurves that lie on the character's bind pose, "library" for all styles of the library, or
            the names of some; the character's own if none, without those of others in its file.
        motion: BVH files, or USD files that animate a skeleton; made-up motion is always added.
        skeleton: prim path of the skeleton wanted, if there are several.
        head: joint that is the head, if its name does not tell.
        joints: semantic joint -> joint, if names are not enough.
        seed: for everything random.
        variations: of each style of the library, besides the style itself; MOST_VARIATIONS at most.
        gestures: how often made-up motion has each kind of gesture, relative to the others.
        tell: called with notes for the user.
        progress: called with (done, total, message) while styles grow.
        **settings: further fields of TrainingScene.

    Raises:
        NeuralocksError: a file is missing or cannot be used, there is no hair, variations are asked for without the library, or too
            many, or an unknown gesture.
    """
    grooms, motion = ([words] if isinstance(words, str | Path) else words for words in (grooms, motion))
    if not 0 <= variations <= MOST_VARIATIONS:
        raise NeuralocksError(f"--variations {variations}: must be from 0 to {MOST_VARIATIONS}")
    if variations and not any(map(_is_style, grooms)):
        raise NeuralocksError(
            f"--variations {variations}: apply to the library's styles; add --groom {LIBRARY}, or leave it out"
        )
    _check_words(grooms, motion)
    weights = check_weights(gestures or {})
    rigs = read_rigs(character, skeleton, head, joints)
    rig = rigs[0]
    notes = [*first_of(rigs), *rig.notes, *unfound(rig), *unlikely_head(rig)]
    found: list[StrandSet] = []
    if styles := [style for style in STYLES if style in grooms or LIBRARY in grooms]:
        found += _library(rig.character, styles, seed, variations, progress or silent)
    for source in grooms or [str(character)]:
        if not _is_style(source):
            found += _file(source, rig, head, joints, notes)
    clips = tuple(read_clip(path, rig.character, notes, rig.border) for path in motion)
    scene = TrainingScene(rig.character, tuple(found), clips, seed=seed, gestures=weights, **settings)
    notes += [
        f"{path}: moves for less than {LEAST * scene.span:.1f} s at a time, too short to learn from; give longer motion"
        for path, clip in zip(motion, clips, strict=True)
        if not scene.usable(clip)
    ]
    if tell:
        tell(list(dict.fromkeys(notes)))
    return scene


def _is_style(source: str) -> bool:
    return source == LIBRARY or source in STYLES


def _check_words(grooms, motion) -> None:
    """Refuse what is not there before the first style grows, which takes seconds each."""
    for source in grooms:
        if not _is_style(source) and not as_path(source, "grooms").exists():
            raise NeuralocksError(
                f"{source}: is neither a file nor a style; check the path, or use one of {LIBRARY}, {', '.join(STYLES)}"
            )
    for path in motion:
        check_file(as_path(path, "motion"))


@names_damage
def _file(
    source: str, rig: StageRig, head: str | None, joints: dict[str, str] | None, notes: list[str]
) -> list[StrandSet]:
    stage = open_stage(source)
    prims = find_curves(stage)
    if not prims:
        raise NeuralocksError(f"{source}: holds no groom (no BasisCurves prim); give a groom, or '{LIBRARY}'")
    prims = open_curves(prims)
    empty = without_points(prims)
    prims, brought = [prim for prim in prims if prim not in empty], None
    if stage.GetRootLayer() == rig.joints.prim.GetStage().GetRootLayer():
        prims = _own(prims, rig, head, joints, notes)
    else:
        brought = rig.border.from_core @ rig.border.unless_told(stage).to_core
    found = [(prim, attach(prim, [rig], Placement(prim, brought), head, notes)) for prim in prims]
    # If there is hair, far curves such as the grass of a set are not hair; nor are the rig's controls.
    near = [(prim, attachment) for prim, attachment in found if not attachment.far] or found
    notes += [
        f"{prim.GetPath()}: lies {a.far:.3g} m from joint '{leaf(a.joint)}' of {rig.path} and on "
        "no skin, so this trains on hair that is not on the head; put it where the head is in the bind pose, and check the file's "
        "metersPerUnit and upAxis"
        for prim, a in near
        if a.far
    ]
    found = [_strands(groom_between(prim, a.to_bind, notes, drawn=a.drawn)[0], a.character) for prim, a in near]
    if not any(strands.valid.any() for strands in found):
        raise NeuralocksError(f"{source}: no strand has two distinct points; there is nothing to learn from")
    return [strands for strands in found if strands.valid.any()]


def _own(prims, rig: StageRig, head: str | None, joints: dict[str, str] | None, notes: list[str]) -> list[Usd.Prim]:
    """The curves in the character's own file that are not those of another character in it, with a note on the others.

    Raises:
        NeuralocksError: all are another's.
    """
    stage = rig.joints.prim.GetStage()
    skeletons = find_skeletons(stage)
    if len(skeletons) < 2:
        return prims
    read = read_each_rig(stage, skeletons, rig.border, head, joints=joints)[0]
    others = [other for other in read if other.path != rig.path and not one_person(rig, other)]
    strangers = {str(prim.GetPath()) for prim in skeletons} - {each.path for each in read if each not in others}
    carriers = {}
    for prim in prims:
        if (bound := bound_skeleton(prim)) in strangers:
            carriers[prim] = bound
        elif bound is None and (other := of_another(prim, [rig], others, Placement(prim), head)):
            carriers[prim] = other.path
    facts = [f"{prim.GetPath()}: is hair of {other}, not of {rig.path}" for prim, other in carriers.items()]
    if len(facts) == len(prims):
        raise NeuralocksError(f"{facts[0]}; choose its character with --skeleton PRIM, or give another groom")
    left = [f"{fact}; left out: train a model of its own for that character, with --skeleton PRIM" for fact in facts]
    notes += few(left, "grooms are other characters' hair")
    return [prim for prim in prims if prim not in carriers]


def _library(
    character: Character, styles: list[str], seed: int, variations: int, progress: Progress
) -> list[StrandSet]:
    """Styles, each grown as among all of them."""
    barber, found, total = Barber(character), [], len(styles) * (1 + variations)
    seeds = {style: seed + i for i, style in enumerate(STYLES)}
    for variation in range(1 + variations):
        for style in styles:
            progress(len(found), total, f"growing {style}")
            found.append(_strands(barber.grow(style, MOST_STRANDS, seeds[style], variation), character))
    return found


def _strands(groom: Groom, character: Character) -> StrandSet:
    strands = strands_on(character, groom)
    if len(strands.rest) <= MOST_STRANDS:
        return strands
    return strands.subset(strands.whole_locks(MOST_STRANDS))  # neighbours stay neighbours
