# SPDX-License-Identifier: Apache-2.0
"""Bake rigged mesh hair: one SkelAnimation in an override layer, the body's joints as they were, the hair's from
the network.
"""

import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.network import RigModel, RigSampler
from neuralocks_core.rotation import rotation_part, to_quaternion

from .rig_stage import RiggedHair, read_rigged_hair, weight_notes
from .time_codes import time_codes

NAME = "NeuralocksHair"
"""The SkelAnimation, a child of the skeleton."""


@dataclass(frozen=True)
class RigBakeResult:
    """What a rig bake wrote.

    Attributes:
        path: the override layer.
        skeleton: the Skeleton prim.
        animation: the new SkelAnimation prim.
        joints: how many hair joints move.
        samples: time codes of the rotations.
        notes: what a user should know.
    """

    path: Path
    skeleton: str
    animation: str
    joints: int
    samples: int
    notes: list[str]


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
    progress=None,
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
        loop: the clip's last sample is followed by its first.
        strength: motion strength of a dynamic model, 0 to 1.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: shot, model or output cannot be used.
    """
    out, shot = Path(out), Path(shot)
    if out.suffix not in (".usd", ".usda", ".usdc"):
        raise NeuralocksError(f"{out}: not a USD file name; end it in .usd, .usda or .usdc")
    if out.exists() and shot.exists() and os.path.samefile(out, shot):
        raise NeuralocksError(f"{out}: the output would overwrite the shot; choose another name")
    if not 0 <= strength <= 2:
        raise NeuralocksError(f"--strength {strength}: must lie between 0 and 2")
    model = model if isinstance(model, RigModel) else RigModel.load(model)
    hair = _read(shot, skeleton, head, model)
    source = hair.source.source
    if str(out.resolve()) in {layer.realPath for layer in hair.stage.GetUsedLayers()}:
        raise NeuralocksError(f"{out}: the output is part of the shot; choose another name")
    _check_moves(hair)
    codes = _codes(hair, frames, subframes)
    joints = _columns(source, model, hair)
    turns = _turns(hair, model, codes, loop, strength, progress)
    layer = _layer(hair, shot, out, codes, joints, turns)
    _save(layer, out)
    animation = str(source.prim.GetPath().AppendChild(NAME))
    notes = [*hair.source.notes, *weight_notes(hair.source), *_name_notes(source)]
    return RigBakeResult(out, source.path, animation, len(model.chains), len(codes), notes)


def _read(shot, skeleton, head, model) -> RiggedHair:
    # The model knows its joints: no guess is made about which ones are hair.
    tops = [model.chains.names[i] for i in model.chains.roots]
    try:
        hair = read_rigged_hair(shot, skeleton=skeleton, head=head, chains=tops)
    except NeuralocksError as error:
        if "--chains" in str(error) and "no joint has such a name" in str(error):
            raise NeuralocksError(
                f"{shot}: no joint of the model's {len(tops)} hair chains ({tops[0]}, ...) is in it; "
                "give a model trained for this rig (neuralocks rig train)"
            ) from None
        raise
    model.chains.match(hair.source.character.skeleton.names)
    model.chains.check_same(hair.rig.chains)
    return hair


def _check_moves(hair: RiggedHair) -> None:
    head = hair.source.character.head
    moved = np.ptp(hair.source.clip.joints[:, head], axis=0).max()
    if moved < 1e-7:
        name = hair.source.character.skeleton.names[head].rsplit("/", 1)[-1]
        raise NeuralocksError(
            f"{hair.source.path}: its head joint '{name}' is not animated, so the hair would not move; "
            "animate the skeleton, or name the joint that carries the hair with --head JOINT"
        )


def _codes(hair: RiggedHair, frames, subframes) -> list[float]:
    """What was asked for and the animation's own samples: the body must come out sample for sample."""
    stage, own = hair.stage, _rotation_samples(hair)
    known = hair.source.time_codes
    ranged = stage.HasAuthoredTimeCodeRange()
    first = stage.GetStartTimeCode() if ranged else float(known[0])
    last = stage.GetEndTimeCode() if ranged else float(known[-1])
    wanted = time_codes(frames, first, max(first, last), subframes)
    return sorted(set(wanted) | set(own))


def _rotation_samples(hair: RiggedHair) -> list[float]:
    animation = hair.source.source.animation
    return [] if animation is None else list(UsdSkel.Animation(animation).GetRotationsAttr().GetTimeSamples())


def _columns(source, model: RigModel, hair: RiggedHair):
    """The animation's joint order with missing hair joints appended, and for each hair joint its place and local
    bind rotation.
    """
    animated = UsdSkel.Animation(source.animation) if source.animation is not None and source.animated else None
    own = [str(name) for name in animated.GetJointsAttr().Get() or ()] if animated else []
    usable = bool(own) and source._columns is not None
    order = list(own) if usable else list(source.names)
    indices = model.chains.match(source.names)
    order += [source.names[j] for j in indices if source.names[j] not in order]
    above = source.parents[indices]
    local = np.linalg.inv(source.bind[above]) @ source.bind[indices]
    return order, usable, indices, [order.index(source.names[j]) for j in indices], to_quaternion(rotation_part(local))


def _turns(hair, model, codes, loop, strength, progress) -> np.ndarray:
    """Turns of the hair joints (T, N, 4) wxyz in their own bind axes."""
    clip = replace(hair.source.clip, loop=True) if loop else hair.source.clip
    sampler = RigSampler(model.spec, hair.source.character, clip)
    turns = np.empty((len(codes), len(model.chains), 4))
    for row, code in enumerate(codes):
        # One at a time: a matrix product may round otherwise for other batches.
        second = hair.border.seconds([code])
        shown = (
            clip.at(second) if loop and not clip.start <= second[0] <= clip.end else hair.source.joints_at(code)[None]
        )
        turns[row] = model.evaluate(sampler.features(second, strength, shown)[0])
        if progress:
            progress(row + 1, len(codes), "hair joints")
    return turns


def _layer(hair, shot, out, codes, joints, turns) -> Sdf.Layer:
    order, usable, indices, places, rest = joints
    source, stage = hair.source.source, hair.stage
    layer = Sdf.Layer.CreateAnonymous(out.suffix)
    _metadata(layer, hair, shot, out, codes)
    path = source.prim.GetPath()
    over = Sdf.CreatePrimInLayer(layer, path)
    for above in path.GetPrefixes():
        if stage.GetPrimAtPath(above).IsInstance():
            layer.GetPrimAtPath(above).instanceable = False  # what lies inside an instance cannot be overridden
    if not source.prim.HasAPI(UsdSkel.BindingAPI):
        over.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["SkelBindingAPI"]))
    relation = Sdf.RelationshipSpec(over, "skel:animationSource", custom=False)
    relation.targetPathList.explicitItems = [path.AppendChild(NAME)]
    prim = Sdf.PrimSpec(over, NAME, Sdf.SpecifierDef, "SkelAnimation")
    names = Sdf.ValueTypeNames
    joint_list = Sdf.AttributeSpec(prim, "joints", names.TokenArray, Sdf.VariabilityUniform)
    joint_list.default = Vt.TokenArray(order)
    kinds = {
        "translations": (names.Float3Array, Vt.Vec3fArray, 3),
        "rotations": (names.QuatfArray, None, 4),
        "scales": (names.Half3Array, None, 3),
    }
    own = UsdSkel.Animation(source.animation) if usable else None
    fallback = _bind_channels(source, order)
    for name, (kind, _, _) in kinds.items():
        Sdf.AttributeSpec(prim, name, kind)
        target = prim.path.AppendProperty(name)
        attribute = own.GetPrim().GetAttribute(name) if own else None
        if name == "rotations":
            for code, turn in zip(codes, turns):
                values = _joined(attribute, code, fallback[name], order)
                final = _product(rest, turn)
                for place, q in zip(places, final):
                    values[place] = Gf.Quatf(*map(float, q))
                layer.SetTimeSample(target, float(code), Vt.QuatfArray(values))
            continue
        samples = list(attribute.GetTimeSamples()) if attribute else []
        array = Vt.Vec3fArray if name == "translations" else Vt.Vec3hArray
        if not samples:
            prim.attributes[name].default = array(_joined(attribute, Usd.TimeCode.Default(), fallback[name], order))
        for code in samples:
            layer.SetTimeSample(target, float(code), array(_joined(attribute, code, fallback[name], order)))
    if source.animation is not None:
        _blend_shapes(layer, prim, UsdSkel.Animation(source.animation))
    return layer


def _bind_channels(source, order) -> dict:
    """Local bind transforms in this joint order, as lists of Gf values."""
    place = {name: i for i, name in enumerate(source.names)}
    known = [place.get(name, -1) for name in order]
    above = np.where((source.parents >= 0)[:, None, None], source.bind[source.parents], np.eye(4))
    local = np.linalg.inv(above) @ source.bind
    size = np.linalg.norm(local[:, :3, :3], axis=1)
    size[np.linalg.det(local[:, :3, :3]) < 0, 0] *= -1
    turn = to_quaternion(local[:, :3, :3] / size[:, None, :])
    still = (Gf.Vec3f(0), Gf.Quatf(1), Gf.Vec3h(1))
    rows = [
        (Gf.Vec3f(*map(float, local[j, :3, 3])), Gf.Quatf(*map(float, turn[j])), Gf.Vec3h(*map(float, size[j])))
        if j >= 0
        else still
        for j in known
    ]
    return {name: [row[i] for row in rows] for i, name in enumerate(("translations", "rotations", "scales"))}


def _joined(attribute, code, fallback, order) -> list:
    """The animation's own values, bit for bit, and bind values for what was appended."""
    values = attribute.Get(code) if attribute and attribute.HasValue() else None
    if values is None and attribute and attribute.HasValue():
        values = attribute.Get(Usd.TimeCode.EarliestTime())
    values = list(values) if values is not None else []
    return values + fallback[len(values) :]


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternion products (N, 4) wxyz. The second factors keep w > 0, so no sign flips between samples."""
    aw, av, bw, bv = a[:, :1], a[:, 1:], b[:, :1], b[:, 1:]
    product = np.concatenate(
        [aw * bw - np.sum(av * bv, axis=1, keepdims=True), aw * bv + bw * av + np.cross(av, bv)], axis=1
    )
    return product / np.linalg.norm(product, axis=1, keepdims=True)


def _blend_shapes(layer, prim, animation) -> None:
    names, weights = animation.GetBlendShapesAttr(), animation.GetBlendShapeWeightsAttr()
    if not names.HasAuthoredValue():
        return
    spec = Sdf.AttributeSpec(prim, "blendShapes", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
    spec.default = names.Get()
    if weights.HasAuthoredValue():
        spec = Sdf.AttributeSpec(prim, "blendShapeWeights", Sdf.ValueTypeNames.FloatArray)
        if weights.Get(Usd.TimeCode.Default()) is not None:
            spec.default = weights.Get(Usd.TimeCode.Default())
        for code in weights.GetTimeSamples():
            layer.SetTimeSample(spec.path, code, weights.Get(code))


def _metadata(layer, hair, shot, out, codes) -> None:
    stage = hair.stage
    relative = os.path.relpath(os.path.realpath(shot), os.path.realpath(out.parent)).replace(os.sep, "/")
    layer.subLayerPaths.append(relative if relative.startswith((".", "/")) else f"./{relative}")
    root = layer.pseudoRoot
    root.SetInfo("metersPerUnit", hair.border.metres_per_unit)
    root.SetInfo("upAxis", hair.border.up_axis)
    layer.timeCodesPerSecond = hair.border.rate
    layer.framesPerSecond = stage.GetFramesPerSecond()
    ranged = stage.HasAuthoredTimeCodeRange()
    layer.startTimeCode = stage.GetStartTimeCode() if ranged else codes[0]
    layer.endTimeCode = stage.GetEndTimeCode() if ranged else codes[-1]
    default = stage.GetDefaultPrim() or next(iter(stage.GetPseudoRoot().GetChildren()))
    layer.defaultPrim = default.GetName()


def _name_notes(source) -> list[str]:
    """Blender reads no bone at all of a skeleton with a ':' in a joint's name, and cuts long or equal names."""
    leaves = [name.rsplit("/", 1)[-1] for name in source.names]
    odd = next((n for n in leaves if ":" in n), None)
    if odd:
        return [
            f"{source.path}: joint '{odd}' has ':' in its name; Blender would import no bones, rename it in the rig"
        ]
    double = next((n for n in leaves if leaves.count(n) > 1), None)
    if double:
        return [f"{source.path}: several joints are named '{double}'; Blender renames all but one"]
    return []


def _save(layer: Sdf.Layer, out: Path) -> None:
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{out.stem}.", suffix=out.suffix, dir=out.parent)
        os.close(handle)
    except OSError as error:
        raise NeuralocksError(f"{out}: cannot be written ({error.strerror}); choose another folder") from None
    try:
        if not layer.Export(temporary, args={"format": "usda" if out.suffix == ".usda" else "usdc"}):
            raise NeuralocksError(f"{out}: cannot be written; check the folder and the space on its disk")
        os.chmod(temporary, 0o644)
        os.replace(temporary, out)
    except OSError as error:
        raise NeuralocksError(f"{out}: cannot be written ({error.strerror}); choose another folder") from None
    finally:
        Path(temporary).unlink(missing_ok=True)
