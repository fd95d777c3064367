# SPDX-License-Identifier: Apache-2.0
"""Bake rigged mesh hair: for each character one SkelAnimation in an override layer, the body's joints as they were, the hair's
from the network.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from neuralocks_core.arguments import flag
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.models.shortcomings import shortcomings
from neuralocks_core.progress import Progress
from neuralocks_core.rig.network import RigModel
from neuralocks_core.wind import check_felt

from ..baking.model_notes import without_strength
from ..border.amounts import check_number
from ..border.damage import names_damage
from ..border.stage_files import check_layer_name, check_not_over
from ..border.stopping import check
from ..border.time_codes import given_cuts
from ..shot.bakes.also_changed import also_changed
from ..shot.notes.range_notes import asked_notes
from ..shot.notes.skeleton_notes import left_out
from ..shot.notes.stage_notes import out_of_place
from ..shot.stage import check_cuts
from ..shot.wind import as_wind, in_core, wind_facts
from ..skel.source import find_skeletons
from .character_bake import BoundHair
from .layer import MovedHair, write_rig_layer
from .stage import of_skeleton, read_rigged_hairs


@dataclass(frozen=True)
class BakedRig:
    """One character in a rig bake.

    Attributes:
        skeleton: the Skeleton prim.
        animation: the new SkelAnimation prim.
        joints: how many hair joints move.
        samples: how many time codes the rotations are written at.
    """

    skeleton: str
    animation: str
    joints: int
    samples: int


@dataclass(frozen=True)
class RigBakeResult:
    """What a rig bake wrote.

    Attributes:
        path: the override layer.
        rigs: the characters whose hair it moves.
        notes: what a user should know.
    """

    path: Path
    rigs: tuple[BakedRig, ...]
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
    wind=None,
    gusts: float | None = None,
    cuts=None,
    joints: dict[str, str] | None = None,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> RigBakeResult:
    """Bake the hair joints of a shot, of every character that has the model's chains.

    Every sample is a function of the motion around it alone, so that order, ranges and rates cannot change it.

    Args:
        shot: USD file with skinned characters, hair chains and an animation.
        out: override layer to write, .usd, .usda or .usdc; muting it gives the shot back.
        model: model file or RigModel; the shipped one if left out.
        skeleton: the only Skeleton prim to bake.
        head: joint that carries the hair.
        frames: as `time_codes.time_codes` takes them; the animation's own samples are always among those written.
        subframes: samples per frame.
        loop: the clip repeats, and its last sample shows the pose of its first.
        strength: motion strength of a dynamic model, from 0 to 2; 1 is as trained.
        wind, gusts: as for `baking.bake.bake`; a dynamic model feels them.
        cuts: time codes at which a character is suddenly elsewhere and its hair starts anew, [] for none; detected if None.
        joints: semantic joint -> joint (path, or its last part), if names are not enough.
        tell: called with the notes known before hair is turned, then with the others.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: shot, model or output cannot be used.
    """
    out, shot = as_path(out, "out"), as_path(shot, "shot")
    check_layer_name(out)
    check_number("--strength", strength, 0, 2)
    loop = flag("--loop", loop)
    model = model if isinstance(model, RigModel) else RigModel.load(model)
    blown = as_wind(wind, gusts)
    check_felt(blown is None or model.feels_wind)
    cuts = given_cuts(cuts, loop)
    found, left = read_rigged_hairs(
        shot, skeleton=skeleton, head=head, joints=joints, cuts=cuts, unbaked=True, model=model.chains
    )
    stage = found[0].stage
    check_not_over(out, stage)
    bound = _each(found, lambda hair: BoundHair.of(hair, model, frames, subframes, blown is not None), left)
    check_cuts(cuts, [one.hair.stage_rig for one in bound])
    notes = [*shortcomings("model", "rig", model.report), *map(left_out, left)]
    for one in bound:
        notes += one.notes(loop, find_cuts=cuts is None)
        notes += asked_notes(stage, [one.hair.stage_rig], one.wanted, loop)
    notes += without_strength(strength, model.dynamic)
    notes = list(dict.fromkeys(notes))
    if tell:
        tell(notes)
    still: list[NeuralocksError] = []
    said: list[str] = []
    counter = _Counter(sum(len(one.codes) for one in bound), progress)

    def moved(one: BoundHair) -> MovedHair:
        turns, held = one.turns(loop, strength, in_core(blown, one.hair.stage_rig.border), counter)
        said.extend(held + one.hair.stage_rig.notes)  # also on poses between those of the clip
        return MovedHair(one.hair, one.codes, turns, one.outdated)

    written = _each(bound, moved, still)
    facts = {"strength": float(strength), "loop": loop, **wind_facts(blown)}
    animations = write_rig_layer(written, shot, out, facts)
    late = [text for text in dict.fromkeys([*map(left_out, still), *said]) if text not in notes]
    late += also_changed((one.hair.stage_rig.joints.prim for one in written), find_skeletons(stage))
    late += out_of_place(stage, out)
    if tell:
        tell(late)
    rigs = [
        BakedRig(one.hair.path, animation, len(one.joints), len(one.codes))
        for one, animation in zip(written, animations)
    ]
    return RigBakeResult(out, tuple(rigs), notes + late)


def _each(characters: list, work: Callable, left: list[NeuralocksError]) -> list:
    """What `work` returns for each character without an error; `left` takes the errors of the others.

    Raises:
        NeuralocksError: the first error, if no character is left.
    """
    done, first = [], None
    for character in characters:
        try:
            done.append(work(character))
        except NeuralocksError as error:
            check()  # the error may come from a stop by the user
            first = first or (type(error), error.args)  # the error itself would hold the stage
            left.append(of_skeleton(character.path, error))
    if not done:
        kind, arguments = first
        raise kind(*arguments)
    return done


class _Counter:
    """Counts the samples of all characters."""

    def __init__(self, total: int, progress: Progress | None):
        self._done, self._total, self._progress = 0, total, progress

    def __call__(self) -> None:
        self._done += 1
        if self._progress:
            self._progress(self._done, self._total, "hair joints")
