# SPDX-License-Identifier: Apache-2.0
"""Which curves of a stage are hair, and what carries them: the same answer for a bake and for `inspect`."""

from functools import cached_property

from pxr import Usd

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError

from ...border.placement import Placement, Unplaced
from ...border.told_once import few
from ...skel.binding import bound_skeleton
from ...skel.stage_rig import StageRig
from ..bakes.bake_record import recorded_skeleton
from ..carriers.attach import Attachment, attach, of_another
from ..carriers.seat_notes import coarsely_placed
from ..characters.others import Others
from ..characters.unusable import Unusable, find_unusable, lies_on
from ..notes.character_notes import unevenly_scaled
from ..notes.groom_notes import another_binds, another_carries, far_from_named, no_points, too_far, unusable_skeleton
from ..strands.curve_ends import undrawn
from ..strands.curves import left_as_they_are, without_points
from .other_curves import drawn_as_copies, other_hair
from .rig_controls import controls_left_out, is_closed, is_lone_guide, moved_as_open


class HairSearch:
    """Tells hair from other curves; the notes name what is left out.

    Args:
        rigs: skeletons that may carry hair; not empty if `attachment` is called.
        head: the user's `--head`.
        notes: what a user should know is added here.
        named: the user named these curves: none is left out because it is empty or far away.
        others: skeletons whose hair is not wanted; None if there are none.
        forced: the user named the skeleton for these curves: a binding to another does not count.
        as_baked: curves that were baked are hair, wherever they lie, and carried by the skeleton that carried them then.

    Attributes:
        rigs: as given.
        carriers: skeletons that carry what was found.
        on_heads: one attachment for each character on whose head hair was found.
    """

    def __init__(
        self,
        rigs: list[StageRig],
        head: str | None,
        notes: list[str],
        *,
        named: bool = False,
        others: Others | None = None,
        forced: bool = False,
        as_baked: bool = False,
    ):
        self.rigs, self._head, self._notes, self._as_baked = rigs, head, notes, as_baked
        self._named, self._others, self._forced = named, others or None, forced
        self._copied: list[str] = []
        self._far: list[str] = []
        self._unusable: list[str] = []
        self._controls: list[str] = []
        self._off_head: list[str] = []
        self._of_others: list[str] = []
        self._far_off: list[tuple[Usd.Prim, Placement, Attachment]] = []
        self._bound_off: list[tuple[str, str]] = []
        self._of_characters: dict[Character, list[str]] = {}  # notes, made once for all grooms that one joint carries
        self.carriers: list[StageRig] = []
        self.on_heads: list[Attachment] = []

    def no_hair(self) -> list[str]:
        """Why curves are not taken for hair: notes if other hair was found; if none was, the first one is the error."""
        others = [] if self._named else other_hair(self.rigs)
        return (
            few(others) + few(self._unusable) + few(self._far) + controls_left_out(self._controls) + few(self._copied)
        )

    def off_heads(self) -> list[str]:
        """The notes on hair that is not on a head, unless another note on it names its joint."""
        return few(self._off_head, "grooms ride on other joints than the head")

    def of_others(self) -> list[str]:
        """The notes on hair of skeletons other than the named one."""
        return few(self._of_others, "grooms are not its hair")

    def nobodys(self) -> list[str]:
        """Why hair that no other skeleton carries is not taken for the named one's, the nearest first: if the named one has no
        hair, its own may be elsewhere, or bound to something unusable. This reads the other skeletons.
        """
        if not (self._far_off or self._bound_off):
            return []
        others = self._others.rigs if self._others else []
        usable = {rig.path for rig in others}
        nearest = sorted(self._far_off, key=lambda each: each[2].far)
        return [unusable_skeleton(path, own, bound=True) for path, own in self._bound_off if own not in usable] + [
            too_far(prim, found)
            for prim, placement, found in nearest
            if not of_another(prim, self.rigs, others, placement, self._head)
        ]

    def filled(self, curves: list[Usd.Prim]) -> list[Usd.Prim]:
        """The curves that have points, are not closed and are drawn where they are, with a note on the others.

        Raises:
            NeuralocksError: the user named curves of which all are drawn as copies elsewhere.
        """
        copied, moving = drawn_as_copies(curves)
        self._notes += few(moving)
        if copied and self._named and len(copied) == len(curves):
            raise NeuralocksError(next(iter(copied.values())))
        self._copied += copied.values()
        curves = [prim for prim in curves if prim not in copied]
        if not self._named:
            closed = {prim: str(prim.GetPath()) for prim in curves if is_closed(prim) and not self._baked_with(prim)}
            self._controls += closed.values()
            curves = [prim for prim in curves if prim not in closed]
        empty = {} if self._named else without_points(curves)
        self._notes += few([no_points(str(prim.GetPath())) for prim in empty])
        return [prim for prim in curves if prim not in empty]

    def attachment(self, prim: Usd.Prim, placement: Placement) -> Attachment | None:
        """What carries the curves of a prim; None if they are another skeleton's, or not hair.

        Raises:
            NeuralocksError: as `attach`; or the user named the curves, and their skeleton cannot be used.
        """
        told = len(self._notes)
        try:
            return self._attachment(prim, placement)
        except Unplaced as error:
            if self._named or error.prim != prim or bound_skeleton(prim):
                raise
            del self._notes[told:]
            self._far.append(f"{prim.GetPath()}: {error.fact}, so it is not taken for hair; {error.remedy}")
            return None

    def _attachment(self, prim: Usd.Prim, placement: Placement) -> Attachment | None:
        path, baked = str(prim.GetPath()), self._baked_with(prim)
        if not baked and self._left_out(prim, placement):
            return None
        named = self._named or bool(baked)
        if not named and is_lone_guide(prim, self.rigs, placement):
            self._controls.append(path)
            return None
        found = attach(prim, baked or self.rigs, placement, self._head, self._notes)
        if found.far and not named:
            self._far.append(too_far(prim, found))
            return None
        self._notes += [too_far(prim, found, named=True)] if found.far else []
        away = found.off_head
        if away and not found.told:
            self._off_head.append(f"{path}: rides on '{leaf(found.joint)}', not on a head")
        if found.character not in self._of_characters:
            self._of_characters[found.character] = unevenly_scaled(found.carrying)
            if not away:
                self.on_heads.append(found)
        self._notes += moved_as_open(prim) + undrawn(prim) + left_as_they_are(prim)
        self._notes += self._of_characters[found.character]
        self._notes += coarsely_placed(prim, found.rig, found.character, placement)
        if found.rig not in self.carriers:
            self.carriers.append(found.rig)
        return found

    def _baked_with(self, prim: Usd.Prim) -> list[StageRig]:
        """The one of `rigs` that carried the curves in their bake, if that is wanted and recorded."""
        own = recorded_skeleton(prim) if self._as_baked else None
        return [rig for rig in self.rigs if rig.path == own]

    def _left_out(self, prim: Usd.Prim, placement: Placement) -> bool:
        """Whether curves are another skeleton's, or of one that cannot be used; tells why."""
        path, bound = str(prim.GetPath()), bound_skeleton(prim)
        if self._others and (why := self._clearly_of_another(prim, bound, placement)):
            self._of_others.append(why)
            return True
        if bound and not self._forced and all(rig.path != bound for rig in self.rigs):
            # On another's head it would also be skinned by its own skeleton.
            self._without(path, bound, bound=True)
            return True
        if not (bound or self._forced) and (own := self._unusable_below(prim, placement)):
            self._without(path, own.path, bound=False)
            return True
        if not bound:
            _ = placement.reference  # before others are read: hair that cannot be placed is nobody's
            others = self._others.rigs if self._others else []
            if others and (other := of_another(prim, self.rigs, others, placement, self._head)):
                self._of_others.append(another_carries(path, other))
                return True
        return False

    def _clearly_of_another(self, prim: Usd.Prim, bound: str | None, placement: Placement) -> str:
        """Why curves are not the named skeleton's, if that is clear without reading the others; '' if it is not."""
        if bound:
            if any(rig.path == bound for rig in self.rigs):
                return ""
            self._bound_off.append((str(prim.GetPath()), bound))
            return another_binds(str(prim.GetPath()), bound)
        try:
            found = attach(prim, self.rigs, placement, self._head, [])
        except NeuralocksError:  # reported below, unless it is another's
            return ""
        if not found.far:
            return ""
        self._far_off.append((prim, placement, found))
        return far_from_named(prim, found)

    def _without(self, path: str, skeleton: str, bound: bool) -> None:
        """Leave out the curves of a skeleton that cannot be used.

        Raises:
            NeuralocksError: they are named.
        """
        why = unusable_skeleton(path, skeleton, bound, self._named)
        if self._named:
            raise NeuralocksError(why)
        self._unusable.append(why)

    def _unusable_below(self, prim: Usd.Prim, placement: Placement) -> Unusable | None:
        """The unusable skeleton on whose character the curves lie."""
        if not self._unread:
            return None
        rigs = self._every
        try:
            found = attach(prim, rigs, placement, self._head, [])
        except NeuralocksError:  # not clear, or none of them
            found = None
        return lies_on(prim, found, rigs, self._unread, placement)

    @property
    def _every(self) -> list[StageRig]:
        return [*self.rigs, *(self._others.rigs if self._others else ())]

    @cached_property
    def _unread(self) -> list[Unusable]:
        rigs = self._every
        return find_unusable(rigs[0].joints.prim.GetStage(), {rig.path for rig in rigs})
