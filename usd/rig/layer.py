# SPDX-License-Identifier: Apache-2.0
"""The override layer of a rig bake: a SkelAnimation for each character, the shot's own channels with new rotations of the
hair joints.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write
from neuralocks_core.rotation import quaternion_product, relative_to_parents, rotation_part, to_quaternion

from ..baking.layer.header import apply_binding, over_prim, write_header
from ..border.damage import named
from ..border.stage_files import refresh_open
from ..shot.bakes.bake_record import record
from ..skel.joints import JointSource
from ..skel.rig_copy import hair_of, tell_source
from .stage import BAKED, RiggedHair


@dataclass(frozen=True)
class MovedHair:
    """How the hair joints of one character turn.

    Attributes:
        hair: the character as read.
        codes: ascending time codes of the rotations, (T,).
        turns: of the hair joints in their own bind axes as authored, (T, N, 4) wxyz.
        outdated: joints of other hair that an earlier bake moves, as the animation was then.
    """

    hair: RiggedHair
    codes: list[float]
    turns: np.ndarray
    outdated: list[str]

    @property
    def joints(self) -> np.ndarray:
        """Indices of the hair joints in the skeleton, (N,)."""
        return self.hair.rig.chains.joints


def write_rig_layer(characters: list[MovedHair], shot: Path, out: Path, facts: dict) -> list[str]:
    """Write the layer, completely or not at all.

    Args:
        characters: of one shot.
        shot: file that the layer goes over.
        out: file to write.
        facts: how the bake was made, recorded on each.

    Returns:
        path of the new SkelAnimation of each.

    Raises:
        NeuralocksError: the file cannot be written.
    """
    layer, hair = Sdf.Layer.CreateAnonymous(out.suffix), characters[0].hair
    codes = sorted({code for character in characters for code in character.codes})
    write_header(layer, hair.stage, hair.stage_rig.border, shot, out, codes)
    paths = [_write_animation(layer, character) for character in characters]
    for path in paths:
        record(layer.GetPrimAtPath(path), facts)
    _save(layer, out)
    return paths


def _write_animation(layer: Sdf.Layer, character: MovedHair) -> str:
    hair, joints, source = character.hair, character.joints, character.hair.stage_rig.joints
    prim = _animation_spec(layer, hair)
    own = _usable_animation(source)
    order = [str(name) for name in own.GetJointsAttr().Get()] if own else []
    moved, kept = [source.names[j] for j in joints], kept_hair(source, joints)
    order += [name for name in (*moved, *kept) if name not in order]
    names = Sdf.ValueTypeNames
    Sdf.AttributeSpec(prim, "joints", names.TokenArray, Sdf.VariabilityUniform).default = Vt.TokenArray(order)
    rest = _rest_channels(source, order)
    _copy_channel(prim, own, "translations", names.Float3Array, Vt.Vec3fArray, rest)
    _copy_channel(prim, own, "scales", names.Half3Array, Vt.Vec3hArray, rest)
    spec = Sdf.AttributeSpec(prim, "rotations", names.QuatfArray)
    places = [order.index(name) for name in moved]
    bind = to_quaternion(rotation_part(relative_to_parents(source.bind, source.parents)[joints]))
    attribute = own.GetRotationsAttr() if own else None
    if _has_default(attribute):
        spec.default = Vt.QuatfArray(_joined(attribute, Usd.TimeCode.Default(), rest["rotations"]))
    for code, turn in zip(character.codes, character.turns):
        values = _joined(attribute, code, rest["rotations"])
        # The second factors keep w > 0, so no sign flips between samples.
        for place, q in zip(places, quaternion_product(bind, turn)):
            values[place] = Gf.Quatf(*map(float, q))
        former = UsdSkel.Animation(source.copied).GetRotationsAttr().Get(code) if kept else ()
        for name, column in kept.items():
            values[order.index(name)] = former[column]
        layer.SetTimeSample(spec.path, float(code), Vt.QuatfArray(values))
    if source.animation is not None:
        _blend_shapes(layer, prim, UsdSkel.Animation(source.animation))
        tell_source(prim, source.animation, [*moved, *kept], character.outdated)
    _hide_former(prim, source.prim.GetStage().GetPrimAtPath(prim.path))
    return str(prim.path)


def _copy_channel(prim: Sdf.PrimSpec, own: UsdSkel.Animation | None, name: str, kind, array: type, rest: dict) -> None:
    """Write a channel that a bake does not change: the samples of the shot's own animation, and rest values of what it leaves out."""
    spec = Sdf.AttributeSpec(prim, name, kind)
    attribute = own.GetPrim().GetAttribute(name) if own else None
    samples = attribute.GetTimeSamples() if attribute else []
    if not samples or _has_default(attribute):
        spec.default = array(_joined(attribute, Usd.TimeCode.Default(), rest[name]))
    for code in samples:
        prim.layer.SetTimeSample(spec.path, code, array(_joined(attribute, code, rest[name])))


def kept_hair(source: JointSource, joints: np.ndarray) -> dict[str, int]:
    """Joints -> columns of an earlier bake that moves them and was made for other hair than `joints` (N,)."""
    if source.copied is None:
        return {}
    moved, listed = {source.names[j] for j in joints}, UsdSkel.Animation(source.copied).GetJointsAttr().Get()
    column = {str(name): number for number, name in enumerate(listed or ())}
    return {name: column[name] for name in hair_of(source.copied) if name in column and name not in moved}


def _animation_spec(layer: Sdf.Layer, hair: RiggedHair) -> Sdf.PrimSpec:
    """A new SkelAnimation below the skeleton, and the skeleton bound to it."""
    source = hair.stage_rig.joints
    over = over_prim(layer, source.prim)
    apply_binding(over, source.prim)
    relation = Sdf.RelationshipSpec(over, "skel:animationSource", custom=False)
    relation.targetPathList.explicitItems = [over.path.AppendChild(BAKED)]
    return Sdf.PrimSpec(over, BAKED, Sdf.SpecifierDef, "SkelAnimation")


def _hide_former(prim: Sdf.PrimSpec, former: Usd.Prim) -> None:
    """Let nothing of an earlier bake at the same path, which may be switched off, show through: its blend shapes, say."""
    if not former:
        return
    if not former.IsActive():
        prim.active = True
    for name in ("rotations", "blendShapes", "blendShapeWeights"):
        attribute, spec = former.GetAttribute(name), prim.attributes.get(name)
        if not attribute.HasAuthoredValue():
            continue
        if spec is None:
            spec = Sdf.AttributeSpec(prim, name, attribute.GetTypeName(), attribute.GetVariability())
        if not spec.HasInfo("default") and (_has_default(attribute) or not spec.HasInfo("timeSamples")):
            spec.default = Sdf.ValueBlock()


def _usable_animation(source: JointSource) -> UsdSkel.Animation | None:
    """The shot's own animation, unless UsdSkel ignores it and shows the rest pose."""
    return UsdSkel.Animation(source.animation) if source.moves_joints else None


def _rest_channels(source: JointSource, order: list[str]) -> dict:
    """Local rest transforms in this joint order, as lists of Gf values: what UsdSkel shows of joints that an animation
    leaves out.
    """
    place = {name: i for i, name in enumerate(source.names)}
    size = np.linalg.norm(source.rest[:, :3, :3], axis=1)
    size[np.linalg.det(source.rest[:, :3, :3]) < 0, 0] *= -1
    turn = to_quaternion(source.rest[:, :3, :3] / size[:, None, :])
    still = (Gf.Vec3f(0), Gf.Quatf(1), Gf.Vec3h(1))
    rows = [still] * len(order)
    for row, name in enumerate(order):
        if name in place:  # an animation may name joints that the skeleton does not have
            j = place[name]
            shift, scale = (map(float, values) for values in (source.rest[j, :3, 3], size[j]))
            rows[row] = (Gf.Vec3f(*shift), Gf.Quatf(*map(float, turn[j])), Gf.Vec3h(*scale))
    return {name: [row[i] for row in rows] for i, name in enumerate(("translations", "rotations", "scales"))}


def _joined(attribute, code, rest: list) -> list:
    """The animation's own values, bit for bit, and those at rest for what was appended."""
    values = list((attribute.Get(code) if attribute else None) or ())
    return values + rest[len(values) :]


def _has_default(attribute) -> bool:
    """Whether a channel has a default value, which is seen if nobody asks for a time."""
    return bool(attribute) and attribute.Get(Usd.TimeCode.Default()) is not None


def _blend_shapes(layer, prim, animation) -> None:
    names, weights = animation.GetBlendShapesAttr(), animation.GetBlendShapeWeightsAttr()
    if not names.HasAuthoredValue():
        return
    spec = Sdf.AttributeSpec(prim, "blendShapes", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    spec.default = names.Get()
    if weights.HasAuthoredValue():
        spec = Sdf.AttributeSpec(prim, "blendShapeWeights", Sdf.ValueTypeNames.FloatArray)
        if _has_default(weights):
            spec.default = weights.Get(Usd.TimeCode.Default())
        for code in weights.GetTimeSamples():
            layer.SetTimeSample(spec.path, code, weights.Get(code))


def _save(layer: Sdf.Layer, out: Path) -> None:
    with named(out), atomic_write(out) as part:
        if not layer.Export(str(part), args={"format": "usda" if out.suffix.lower() == ".usda" else "usdc"}):
            raise NeuralocksError(f"{out}: cannot be written; check the folder and the space on its disk")
    refresh_open(out)
