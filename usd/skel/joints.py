# SPDX-License-Identifier: Apache-2.0
"""A UsdSkel skeleton and its animation as arrays in stage space: names, bind pose, and posed joints at any time.

Evaluated here: a UsdSkelSkeletonQuery exists only below a SkelRoot and takes one time at a time. A test checks that both agree.
"""

from functools import cached_property

import numpy as np
from pxr import Sdf, Usd, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import from_parents, from_quaternion, relative_to_parents

from ..border.arrays import wxyz
from ..border.placement import Placement
from ..border.values import as_names, as_numbers
from .joint_parents import joint_parents
from .keys import Keys
from .rig_copy import hair_of, source_of

STRETCH = 0.003
"""A quaternion's length may be off by this much without a note: single and half precision are nearer."""


class JointSource:
    """One Skeleton prim.

    Attributes:
        prim: the Skeleton.
        names: joint paths (J).
        parents: (J,) int, -1 for a root.
        bind: bind transforms as authored, (J, 4, 4).
        rest: local rest transforms, (J, 4, 4).
        animation: the SkelAnimation prim, or None.
        copied: the SkelAnimation prim of a rig bake in place of which `animation`, its original, is read; or None.
        placement: where the skeleton stands.
        notes: what a user should know about it.
        ignored: the note that says why the animation does not count; None if it does, or if there is none.

    Args:
        prim: the Skeleton.
        unbaked: read the animation that a rig bake copied instead of its copy.

    Raises:
        NeuralocksError: it has no joints, or arrays that do not fit each other.
    """

    def __init__(self, prim: Usd.Prim, unbaked: bool = False):
        self.prim, self.path = prim, str(prim.GetPath())
        self._stage = prim.GetStage()  # a prim alone does not keep its stage open
        self.notes: list[str] = []
        self.ignored: str | None = None
        self._told_lengths = False
        skeleton = UsdSkel.Skeleton(prim)
        self.names = _names(skeleton.GetJointsAttr())
        if not self.names:
            raise NeuralocksError(f"{self.path}: the skeleton has no joints; export it with its joints")
        self.parents = joint_parents(self.path, self.names)
        self.bind, self.rest = self._bind_and_rest(skeleton)
        self.placement = Placement(prim)
        source, self.copied = UsdSkel.BindingAPI(prim).GetInheritedAnimationSource(), None
        if unbaked and source and (original := source_of(source)):
            source, self.copied = original, source
        self.animation = source if source and source.IsA(UsdSkel.Animation) and source.IsActive() else None
        if source and not source.IsActive():
            self._ignore(
                f"{source.GetPath()}: is inactive, so UsdSkel ignores it; activate it, or bind another animation"
            )
        self._animation = UsdSkel.Animation(self.animation) if self.animation else None
        self._columns = self._animated_joints()

    @cached_property
    def keys(self) -> Keys:
        """When the animation, and the parents if they move, have samples."""
        face = [] if self._animation is None else [self._animation.GetBlendShapeWeightsAttr()]
        joints, face = ([(each.GetTimeSamples(), each.Get) for each in own] for own in (self.channels, face))
        return Keys.of(joints, [(self.placement.samples, self.placement.at)], face)

    @property
    def animated(self) -> bool:
        """Whether a SkelAnimation, of joints or of a face alone, or a parent's transform drives it."""
        return self._columns is not None or bool(self.keys.every)

    @property
    def moves_joints(self) -> bool:
        """Whether a SkelAnimation gives the pose; otherwise UsdSkel shows the rest pose."""
        return self._columns is not None

    @property
    def baked_hair(self) -> tuple[str, ...]:
        """The joints that a rig bake of this stage moves."""
        bake = self.copied or self.animation
        return hair_of(bake) if bake else ()

    def posed(self, time_codes) -> np.ndarray:
        """Joints (T, J, 4, 4) in stage world space at time codes (T,), as UsdSkel evaluates them."""
        # A shot may go on for thousands of frames after its animation: a pose that is held is computed once.
        codes, rows = np.unique(np.clip(time_codes, *self._keyed), return_inverse=True)
        return (
            np.stack([self.placement.at(t) for t in time_codes])[:, None]
            @ from_parents(self.local(codes), self.parents)[rows]
        )

    @property
    def at_rest(self) -> np.ndarray:
        """Joints (J, 4, 4) in stage world space in the rest pose, which UsdSkel shows without an animation."""
        return self.placement.reference @ from_parents(self.rest, self.parents)

    @property
    def channels(self) -> tuple[Usd.Attribute, ...]:
        """What moves the joints; nothing if UsdSkel shows the rest pose."""
        return () if self._columns is None else self._channels()

    @cached_property
    def _keyed(self) -> tuple[float, float]:
        """First and last time code at which the animation has a sample of a joint: it holds its poses before and after."""
        codes = [code for channel in self.channels for code in channel.GetTimeSamples()]
        return (min(codes), max(codes)) if codes else (0.0, 0.0)

    @property
    def shape_names(self) -> tuple[str, ...]:
        """The blend shapes that the animation moves."""
        return () if self._animation is None else _names(self._animation.GetBlendShapesAttr())

    def shape(self, names, time_codes) -> np.ndarray:
        """Blend shape weights (T, B) of the named shapes at time codes (T,); 0 where the animation has none.

        Raises:
            NeuralocksError: the animation has another number of weights than of shapes, or one that is not finite.
        """
        result = np.zeros((len(time_codes), len(names)))
        order = self.shape_names
        wanted = [(column, order.index(name)) for column, name in enumerate(names) if name in order]
        if not wanted:
            return result
        weights = self._animation.GetBlendShapeWeightsAttr()
        for row, time in enumerate(time_codes):
            values = as_numbers(weights, "float[]", weights.Get(time) if weights.HasValue() else None)
            if len(values) != len(order):
                raise NeuralocksError(
                    f"{self.animation.GetPath()}: {len(values)} blendShapeWeights for {len(order)} blendShapes; "
                    "author one each"
                )
            result[row, [c for c, _ in wanted]] = values[[i for _, i in wanted]]
        if not np.isfinite(result).all():
            raise NeuralocksError(
                f"{self.animation.GetPath()}: blendShapeWeights hold NaN or infinity; repair the animation"
            )
        return result

    def _bind_and_rest(self, skeleton: UsdSkel.Skeleton) -> tuple[np.ndarray, np.ndarray]:
        bind, rest = (self._matrices(a) for a in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()))
        if bind is None and rest is None:
            raise NeuralocksError(
                f"{self.path}: has neither bindTransforms nor restTransforms; export it with its bind pose"
            )
        if bind is None:
            self.notes.append(f"{self.path}: no bindTransforms; the rest pose serves as bind pose")
            bind = from_parents(rest, self.parents)
        if rest is None:
            rest = relative_to_parents(bind, self.parents)
        return bind, rest

    def _matrices(self, attribute: Usd.Attribute) -> np.ndarray | None:
        values = as_numbers(attribute, "matrix4d[]", attribute.Get())
        if not len(values):
            return None
        if len(values) != len(self.names):
            raise NeuralocksError(
                f"{self.path}: {len(values)} {attribute.GetName()} for {len(self.names)} joints; author one each"
            )
        matrices = values.copy().swapaxes(-1, -2)
        bad = ~np.isfinite(matrices).all(axis=(1, 2))
        flat = ~bad & (np.abs(np.linalg.det(np.where(bad[:, None, None], np.eye(4), matrices)[:, :3, :3])) < 1e-18)
        if (bad | flat).any():
            joint = int(np.flatnonzero(bad | flat)[0])
            fact = "holds NaN or infinity" if bad[joint] else "has zero scale"
            raise NeuralocksError(
                f"{self.path}: {attribute.GetName()} of joint '{self.names[joint]}' {fact}; repair it"
            )
        return matrices

    def _channels(self):
        animation = self._animation
        return animation.GetTranslationsAttr(), animation.GetRotationsAttr(), animation.GetScalesAttr()

    def _animated_joints(self) -> list[tuple[int, int]] | None:
        """(joint, column of the animation) pairs; None where UsdSkel would show the rest pose instead."""
        if self._animation is None:
            return None
        listed = _names(self._animation.GetJointsAttr())
        if not listed and self._of_a_face:
            return None
        order = {name: i for i, name in enumerate(listed)}
        pairs = [(joint, order[name]) for joint, name in enumerate(self.names) if name in order]
        why = self._unusable_channel()
        if not why and not pairs:
            why = f"{self.animation.GetPath()}: animates no joint of {self.path}; check its joint paths"
        if why:
            self._ignore(why)
            return None
        if double := next((name for i, name in enumerate(listed) if order[name] != i), None):
            raise NeuralocksError(f"{self.animation.GetPath()}: joint '{double}' is listed twice; list each once")
        self._width = len(listed)
        return pairs

    @property
    def _of_a_face(self) -> bool:
        """Whether the animation moves blend shapes and is not meant to move joints; UsdSkel applies it."""
        weights, channels = self._animation.GetBlendShapeWeightsAttr(), self._channels()
        return weights.HasAuthoredValue() and not any(channel.HasAuthoredValue() for channel in channels)

    def _ignore(self, why: str) -> None:
        self.ignored = why
        self.notes.append(why)

    def _unusable_channel(self) -> str | None:
        """What is wrong with a channel that makes UsdSkel ignore the animation; None if nothing is."""
        path = self.animation.GetPath()
        for attribute, kind in zip(self._channels(), (Vt.Vec3fArray, Vt.QuatfArray, Vt.Vec3hArray)):
            name = attribute.GetName()
            if not attribute.HasValue():
                return f"{path}: no {name}, so UsdSkel ignores the animation; author all three channels"
            values = attribute.Get(Usd.TimeCode.EarliestTime())
            if not isinstance(values, kind | None):
                own, wanted = (Sdf.GetValueTypeNameForValue(each) for each in (values, kind()))
                return f"{path}: its {name} are {own}, so UsdSkel ignores the animation; author {wanted}"
        return None

    def local(self, time_codes) -> np.ndarray:
        """Joints (T, J, 4, 4) relative to their parents at time codes (T,).

        Raises:
            NeuralocksError: the animation has no value for each of its joints, or one that is no transform.
        """
        result = np.broadcast_to(self.rest, (len(time_codes), *self.rest.shape)).copy()
        if self._columns is None:
            return result
        joints, columns = (np.array(side) for side in zip(*self._columns, strict=True))
        translation, turn, scale = (np.empty((len(time_codes), self._width, n)) for n in (3, 4, 3))
        for row, time in enumerate(time_codes):
            for target, attribute, quaternions in zip(
                (translation, turn, scale), self._channels(), (False, True, False), strict=True
            ):
                values = attribute.Get(time)
                if values is None or len(values) != self._width:
                    count = 0 if values is None else len(values)
                    raise NeuralocksError(
                        f"{self.animation.GetPath()}: {count} {attribute.GetName()} at time code {time:g} for {self._width} joints; "
                        "author one each"
                    )
                target[row] = wxyz(values) if quaternions else np.asarray(values, float)
        self._check(time_codes, translation, turn, scale)
        self._note_lengths(time_codes, turn[:, columns], joints)
        result[:, joints, :3, :3] = from_quaternion(turn[:, columns]) * scale[:, columns, None, :]
        result[..., :3, 3][:, joints] = translation[:, columns]
        return result

    def _check(self, time_codes, translation, turn, scale) -> None:
        finite = [np.isfinite(a).all(axis=-1) for a in (translation, turn, scale)]
        good = finite[0] & finite[1] & finite[2] & (np.abs(turn).sum(axis=-1) > 1e-12)
        if good.all():
            return
        row, column = np.argwhere(~good)[0]
        name = _names(self._animation.GetJointsAttr())[int(column)]
        raise NeuralocksError(
            f"{self.animation.GetPath()}: joint '{name}' holds NaN, infinity or a null rotation at time code {time_codes[row]:g}; "
            "repair the animation"
        )

    def _note_lengths(self, time_codes, turns, joints) -> None:
        """Note rotations that UsdSkel would stretch the character by, although they are read as plain ones here."""
        off = np.abs(np.linalg.norm(turns, axis=-1) - 1) > STRETCH
        if self._told_lengths or not off.any():
            return
        self._told_lengths = True
        row, column = np.argwhere(off)[0]
        self.notes.append(
            f"{self.animation.GetPath()}: the rotation of joint '{self.names[joints[column]]}' at time code "
            f"{time_codes[row]:g} is not of unit length, which UsdSkel shows as a stretch; normalise the rotations"
        )


def _names(attribute: Usd.Attribute) -> tuple[str, ...]:
    return as_names(attribute, attribute.Get())
