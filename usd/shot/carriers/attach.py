# SPDX-License-Identifier: Apache-2.0
"""Which skeleton and joint carries a groom, and where the groom lies in that rig's bind pose.

In this order: the groom's own skel binding, the joint that the prim's own animated transform follows where it sits on a mesh,
the binding of that mesh, the joint named by the user, a joint named like a head.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from pxr import Usd, UsdSkel

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import transformed

from ...border.placement import Placement
from ...skel.binding import bound_skeleton, geom_bind, joint_influences
from ...skel.joints import JointSource
from ...skel.stage_rig import StageRig
from ..strands.curve_ends import beyond_ends, ends
from ..strands.curves import moment, rest_points
from .carrying import carried_by, carrying_joint, followed_joint, head_by_name, joint_shares, spread_over
from .seat import NEAR, Seat, begins_where_drawn, find_seat, kinship, some_ends, unsure
from .seat_notes import astray, lies_off_skin, not_pinned, strays, upside_down
from .twin_bodies import one_of_alike
from .ways import CLEARLY, ways

ON_HEAD = 0.3
"""Roots within this distance of a head [m], and within half the length of the trunk, are on it, whatever else is there."""
REACH = 1.0
"""Roots farther from a head than this [m], and than the length of the trunk, are not its hair: grass, cables."""
ALIKE = 2e-3
"""Bodies are alike if hair sits on them equally well up to this [m]."""


@dataclass(frozen=True)
class Attachment:
    """How one groom follows one rig.

    Attributes:
        rig: the skeleton that carries it.
        character: the rig's character, with the joint that carries the groom: its head, one below it, or the one that takes the
            head's role.
        to_bind: the prim's own space to bind world [m], (4, 4).
        how: the carrying joint and how it was found, in words.
        at_default: the same for points that would be authored at the default time, (4, 4), if the shot only has those of a moving
            cache; otherwise None.
        far: distance of the roots from the joint [m], if they are out of its reach and neither a binding nor a skin below says that
            it carries them; otherwise 0.
        drawn: whether the hair begins where its curves are drawn, not at a point before.
        told: whether a note names the carrying joint.
        turned: the note on strands that run from tip to root, if they do.
    """

    rig: StageRig
    character: Character
    to_bind: np.ndarray
    how: str
    at_default: np.ndarray | None = None
    far: float = 0.0
    drawn: bool = False
    told: bool = False
    turned: list[str] = field(default_factory=list)

    @property
    def carrying(self) -> StageRig:
        """The skeleton, with the character of the joint that carries the groom."""
        return replace(self.rig, character=self.character)

    @property
    def joint(self) -> str:
        """Path of the carrying joint."""
        return self.rig.joints.names[self.character.carrying_joint]

    @property
    def off_head(self) -> bool:
        """Whether the carrying joint takes the role of the head while the rig has one elsewhere, as for fur on a chest."""
        own = self.rig.character.humanoid.get("head")
        return own not in (None, self.character.head) and self.character.head != head_by_name(self.rig)


def attach(
    prim: Usd.Prim, rigs: list[StageRig], placement: Placement, head: str | None, notes: list[str]
) -> Attachment:
    """Find what carries the groom.

    Args:
        prim: a BasisCurves.
        rigs: candidates; not empty.
        placement: where the prim stands.
        head: the user's `--head`, used where no binding says otherwise.
        notes: what a user should know is added here.

    Raises:
        NeuralocksError: nothing can carry it, or several things can.
    """
    path = str(prim.GetPath())
    bound = bound_skeleton(prim)
    rig = next((r for r in rigs if r.path == bound), None)
    if rig is not None:
        found = _bound(prim, rig, placement, notes)
    else:
        seats = [seat for rig in rigs if (seat := find_seat(prim, rig, placement, NEAR)) is not None]
        if seats:
            found = _on_mesh(prim, seats, placement, notes)
        else:
            found = _by_name(prim, rigs, placement, head)
            if not found.far and (seat := find_seat(prim, found.rig, placement)) is not None:
                found = replace(found, turned=upside_down(prim, seat.rig, seat.to_bind))
                notes += found.turned or [lies_off_skin(prim, seat)]
        if not found.far:
            notes += strays(prim, found.carrying, placement)
    beyond = beyond_ends(prim)
    found = replace(found, drawn=begins_where_drawn(prim, found.rig, found.to_bind, beyond))
    notes += not_pinned(prim, found.rig, found.drawn, beyond)
    name = found.rig.joints.names[found.character.head]
    asked = found.rig.by_hand.get("head")
    if asked and leaf(name) != leaf(asked):
        option = "--head " if head else "--joint head="
        notes.append(f"{path}: {option}{asked} is not used, the groom is carried by {found.how}")
        return replace(found, told=True)
    return found


def _between_binds(prim: Usd.Prim, rig: StageRig, placement: Placement) -> np.ndarray:
    """From the bind space of a groom's own file to the rig's (4, 4): what brings its stage's space here or, where its file has the same
    skeleton and their bind poses say so, nothing, because a transform above brings its unit.
    """
    if placement.brought is None:
        return np.eye(4)
    skeleton = prim.GetStage().GetPrimAtPath(rig.path)
    theirs = JointSource(skeleton) if skeleton and skeleton.IsA(UsdSkel.Skeleton) else None
    if theirs is None or theirs.names != rig.joints.names:
        return placement.brought
    ours, places = rig.joints.bind[:, :3, 3], theirs.bind[:, :3, 3]
    ways = (np.eye(4), placement.brought)
    return min(ways, key=lambda way: np.abs(transformed(places, way) - ours).max())


def bound_joint(prim: Usd.Prim, rig: StageRig, placement: Placement, seated: bool) -> tuple[str, str] | None:
    """The joint that carries the groom according to a binding, and whose binding that is; None if no binding says. The binding of
    the mesh on which the groom sits counts if it is `seated`.

    Raises:
        NeuralocksError: a binding cannot be used.
    """
    if bound_skeleton(prim) == rig.path:
        joint = _by_own_binding(prim, rig, rig.to_bind @ geom_bind(prim))[0]
        return rig.joints.names[joint], str(prim.GetPath())
    if seated and (seat := find_seat(prim, rig, placement, NEAR)) is not None:
        seat, _ = _of_roots(prim, seat, placement)
        return rig.joints.names[_by_seat(seat)[0]], str(seat.mesh.prim.GetPath())
    return None


def of_another(
    prim: Usd.Prim, rigs: list[StageRig], others: list[StageRig], placement: Placement, head: str | None
) -> StageRig | None:
    """Which of the other skeletons clearly carries the groom, rather than one of these."""
    try:
        found = attach(prim, [*rigs, *others], placement, head, [])
    except NeuralocksError:  # not clear
        return None
    return None if found.far else next((rig for rig in others if rig is found.rig), None)


def on_head(prim: Usd.Prim, found: Attachment) -> bool:
    """Whether the roots are around the carrying joint where a human head would be."""
    return _away(some_ends(prim), found.character, found.to_bind) <= max(ON_HEAD, _trunk(found.rig) / 2)


def _bound(prim: Usd.Prim, rig: StageRig, placement: Placement, notes: list[str]) -> Attachment:
    """The attachment of a groom that is bound to the rig's skeleton itself."""
    to_bind = rig.to_bind @ _between_binds(prim, rig, placement) @ geom_bind(prim)
    joint, why, shares, turned = _by_own_binding(prim, rig, to_bind)
    spread = [] if turned else spread_over(rig, str(prim.GetPath()), joint, shares)
    notes += turned or [*astray(prim, rig, to_bind), *spread]
    return Attachment(
        rig=rig,
        character=carried_by(rig, joint),
        to_bind=to_bind,
        how=f"{why} (its own skel binding)",
        told=bool(spread),
        turned=turned,
    )


def _on_mesh(prim: Usd.Prim, seats: list[Seat], placement: Placement, notes: list[str]) -> Attachment:
    """By the nearest skinned mesh: in its own space, skin and groom agree whatever a file takes for bind space."""
    nearest = min(seat.distance for seat in seats)
    alike = [seat for seat in seats if seat.distance <= nearest + ALIKE]
    seat, turned = _of_roots(prim, one_of_alike(prim, alike, notes), placement)
    rig, mesh = seat.rig, seat.mesh
    joint, why, shares = _by_seat(seat)
    path, to_bind, moved = str(prim.GetPath()), seat.to_bind, moment(prim) is not None
    followed = None if moved else followed_joint(rig, placement)
    spread = [] if followed or turned else spread_over(rig, path, joint, shares)
    if followed is None:
        how = f"{why} (binding of {mesh.prim.GetPath()}, on which it sits)"
    else:
        joint, to_bind = followed
        how = f"joint '{rig.joints.names[joint]}' (which its own transform follows)"
    notes += [*turned, *spread, *unsure(prim, seat, placement)]
    at_default = ways(rig, mesh, placement)[0] if moved else None
    return Attachment(rig, carried_by(rig, joint), to_bind, how, at_default, told=bool(spread), turned=turned)


def _by_name(prim: Usd.Prim, rigs: list[StageRig], placement: Placement, head: str | None) -> Attachment:
    path = str(prim.GetPath())
    able = [r for r in rigs if "head" in r.character.humanoid]
    if not able:
        raise NeuralocksError(
            f"{path}: no joint of {rigs[0].path} is named like a head; name the joint that carries it with --head JOINT"
        )
    roots = some_ends(prim)

    def away(rig: StageRig, to_bind: np.ndarray) -> float:
        return _away(roots, rig.character, to_bind)

    when = moment(prim)
    places = {rig.path: ways(rig, None, placement, when) for rig in able}
    if when is None and all(away(rig, way) > _reach(rig) for rig in able for way in places[rig.path]):
        # Without skin, only what is on the head at that moment is hair: much else stands near it.
        for rig in (rig for rig in able if not rig.meshes):
            posed = ways(rig, None, placement, likely=False)
            places[rig.path] += [way for way in posed if away(rig, way) < _trunk(rig) / 2]
    close = _nearest(prim, [(min(away(rig, way) for way in places[rig.path]), rig) for rig in able])
    nearest, rig = close[0]
    far = nearest if nearest > _reach(rig) else 0.0
    if len(close) > 1 and not far:
        names = ", ".join(r.path for r in able[:5])
        raise NeuralocksError(
            f"{path}: {len(able)} skeletons could carry it ({names}); choose one with --skeleton PRIM"
        )
    to_bind = next(way for way in places[rig.path] if away(rig, way) <= max(CLEARLY * nearest, 1e-3))
    at_default = None if when is None else ways(rig, None, placement)[0]
    why = "named with --head" if head else rig.character.humanoid.reasons.get("head", "named like a head")
    how = f"joint '{rig.joints.names[rig.character.head]}' ({why})"
    return Attachment(rig, rig.character, to_bind, how, at_default, far)


def _nearest(prim: Usd.Prim, able: list[tuple[float, StageRig]]) -> list[tuple[float, StageRig]]:
    """Of skeletons with the distance of their heads from a groom's roots, the nearest; of those that are about as near, the ones among
    whose prims the groom is most closely.
    """
    least = min(distance for distance, _ in able)
    close = [(distance, rig) for distance, rig in able if distance <= 2 * least]
    kin = max(kinship(prim, rig.joints.prim) for _, rig in close)
    return [(distance, rig) for distance, rig in close if kinship(prim, rig.joints.prim) == kin]


def _away(roots: np.ndarray, character: Character, to_bind: np.ndarray) -> float:
    """Distance of roots (n, 3) of a prim from a character's head, in the median [m]."""
    return float(np.median(np.linalg.norm(transformed(roots, to_bind) - character.canonical_to_bind[:3, 3], axis=1)))


def _reach(rig: StageRig) -> float:
    """How far from the carrying joint curves may be [m] if nothing else says that they are hair."""
    return max(REACH, _trunk(rig))


def _trunk(rig: StageRig) -> float:
    """Distance of the carrying joint from the hips [m]."""
    bind = rig.character.skeleton.bind[:, :3, 3]
    return float(np.linalg.norm(bind[rig.character.head] - bind[rig.character.humanoid.get("hips", 0)]))


def _by_own_binding(prim: Usd.Prim, rig: StageRig, to_bind: np.ndarray) -> tuple[int, str, np.ndarray, list[str]]:
    """The joint that carries a groom which is bound to the rig, why, the share (J,) of each joint in its roots, and the note
    on strands that run from tip to root, whose roots are their last points.

    Points farther down are weighted as a rigger wants them to move without simulation, with the chest or an arm.
    """
    indices, weights = joint_influences(prim, len(rest_points(prim)), rig.joints)
    turned = upside_down(prim, rig, to_bind)
    roots = ends(prim, last=bool(turned))
    shares = joint_shares(rig, indices[roots], weights[roots])
    return *carrying_joint(rig, shares, exact=True), shares, turned


def _of_roots(prim: Usd.Prim, seat: Seat, placement: Placement) -> tuple[Seat, list[str]]:
    """The seat of a groom's roots, and the note on strands that run from tip to root: their tips may lie on shoulders."""
    turned = upside_down(prim, seat.rig, seat.to_bind)
    if turned:
        seat = find_seat(prim, seat.rig, placement, NEAR, last=True) or seat
    return seat, turned


def _by_seat(seat: Seat) -> tuple[int, str, np.ndarray]:
    """The joint, why and the shares for a groom that sits on a mesh, by the skin under its roots."""
    shares = joint_shares(seat.rig, seat.mesh.indices[seat.points], seat.mesh.weights[seat.points])
    return *carrying_joint(seat.rig, shares), shares
