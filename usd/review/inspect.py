# SPDX-License-Identifier: Apache-2.0
"""What a file holds, and what would stop or spoil a bake of it."""

from contextlib import suppress
from pathlib import Path

from pxr import Usd, UsdSkel

from neuralocks_core.anatomy.humanoid import NoHead
from neuralocks_core.boundary.spec import POSE_JOINTS
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.models.model_file import SUFFIX
from neuralocks_core.rig.chain_finding import NoHairChains
from neuralocks_core.rig.rigging import assemble_rig

from ..border.damage import names_damage
from ..border.stage_files import OTHERS, USD, open_stage
from ..border.told_once import few
from ..border.units import Border
from ..border.values import as_names
from ..rig.facing import askew_notes
from ..rig.notes import RIG_JOINTS, mirrored_notes, offset_notes
from ..rig.stage import check_authored, check_orients, core_meshes, describe_chains, is_baked, of_bake
from ..rig.uneven import names_uneven_prims
from ..rig.unmoved_joints import left_out_notes, outside_notes, unnamed_notes
from ..shot.bakes.bake_record import recorded, recorded_cuts
from ..shot.characters.skeletons import read_each_rig
from ..shot.characters.whole_body import WholeBodies
from ..shot.notes.character_notes import lies_down, untrained, weight_notes, without_body
from ..shot.notes.missing import no_groom, no_skeleton
from ..shot.notes.motion_notes import motion_notes
from ..shot.notes.range_notes import out_of_range, without_range
from ..shot.notes.skeleton_notes import another_head, left_out, not_animated, partial_body, rig_notes, without_turn
from ..shot.notes.stage_notes import composition_notes, layer_notes
from ..shot.search.hair_search import HairSearch
from ..shot.stage import frame_range
from ..shot.strands.curves import find_curves
from ..skel.source import find_skeletons
from ..skel.stage_rig import StageRig
from .groom_facts import facts_of_grooms, groom_facts


def inspect(path, head: str | None = None, joints: dict[str, str] | None = None) -> dict:
    """Facts about a USD stage, a hair file, a model or a motion file, as plain values.

    Args:
        path: the file.
        head: the joint that would be given with `--head`.
        joints: the joints that would be given with `--joint`.

    Returns:
        `file`, `kind`, facts by kind, `stops` (what would stop a bake) and `spoils` (what a user should know).

    Raises:
        NeuralocksError: the file cannot be read at all.
    """
    path = as_path(path, "path")
    kind = path.suffix.lower()
    if kind in (*USD, *OTHERS):
        return {"file": str(path), "kind": "stage", **_stage(path, head, joints)}
    if path.is_dir():
        raise NeuralocksError(f"{path}: is a folder; name the file in it")
    if not path.is_file():
        fact = "is not a file" if path.exists() else "no such file"
        raise NeuralocksError(f"{path}: {fact}; check the path")
    if kind == SUFFIX:
        return {"file": str(path), "kind": "model", **_model(path)}
    if kind == ".bvh":
        return {"file": str(path), "kind": "motion", **_motion(path)}
    from neuralocks_core import formats

    groom, notes = formats.read_with_notes(path)
    return {"file": str(path), "kind": "hair", "grooms": [groom_facts(groom)], "stops": [], "spoils": notes}


@names_damage
def _stage(path: Path, head: str | None, joints: dict[str, str] | None) -> dict:
    stage = open_stage(path)
    stops: list[str] = []
    border = Border.of(stage)
    spoils = composition_notes(stage, path) + layer_notes(stage, path)
    facts = {"unit [m]": border.metres_per_unit, "up axis": border.up_axis, "rate [1/s]": border.rate}
    prims = find_skeletons(stage)
    rigs, errors = read_each_rig(stage, prims, border, head, all_shapes=True, joints=joints)
    if rigs:
        spoils += few([left_out(error) for error in errors], "skeletons are left out")
    else:
        stops += [str(error) for error in errors] or [str(no_skeleton(stage, Path(path.name)))]
    curves = find_curves(stage)
    told = any(recorded_cuts(prim) is not None for prim in curves)
    skeletons = [_rig(rig) | {"hair chains": _chains(rig, spoils, bool(curves))} | _how_baked(rig) for rig in rigs]
    read = POSE_JOINTS if curves else RIG_JOINTS
    bodies = WholeBodies(rigs)
    for rig in rigs:
        stops += without_turn(rig, read)
        spoils += rig.notes + weight_notes(rig) + rig_notes(rig, read) + another_head(rig) + lies_down(rig)
        spoils += partial_body(rig, bodies.of(rig)[1])
        spoils += [] if told else rig.cut_notes()
    moving = [rig for rig in rigs if rig.joints.animated]
    if moving:
        facts["frames"] = list(frame_range(stage, moving))
        spoils += without_range(stage)
        spoils += [text for rig in moving for text in out_of_range(rig, *facts["frames"])]
    elif rigs and not any("wind" in recorded(prim) for prim in curves):
        stops.append(not_animated(rigs[0]))
    search = HairSearch(rigs, head, spoils, as_baked=True)
    grooms = facts_of_grooms(search, curves, bodies, border, spoils, stops)
    spoils += [note for each in map(bodies.on, search.on_heads) for note in untrained(each.carrying)]
    spoils += search.off_heads() + without_body(search.carriers, rigs)
    hairy = [rig for rig, skeleton in zip(rigs, skeletons) if skeleton["hair chains"]]
    if hairy and not grooms:
        how = "a rig bake moves" if all(map(is_baked, hairy)) else "neuralocks rig train and rig bake move"
        spoils.append(f"{path.name}: holds no groom; {how} its hair chains")
    elif not curves:
        stops.append(str(no_groom(stage, Path(path.name))))
    lines = {"stops": list(dict.fromkeys(stops)), "spoils": list(dict.fromkeys(spoils))}
    unused = [_unused(prim) for prim in prims if str(prim.GetPath()) not in {rig.path for rig in rigs}]
    left = {"skeletons left out": unused} if unused else {}
    return facts | {"skeletons": skeletons, **left, "grooms": grooms} | lines


def _unused(prim: Usd.Prim) -> dict:
    """What can be told of a skeleton that cannot be used: among its joints may be the head that the user is asked for."""
    joints, names = UsdSkel.Skeleton(prim).GetJointsAttr(), ()
    with suppress(NeuralocksError):  # then this is why it cannot be used
        names = as_names(joints, joints.Get())
    return {"path": str(prim.GetPath()), "joint names": list(names)}


def _rig(rig: StageRig) -> dict:
    humanoid = rig.character.humanoid
    found = {name: rig.joints.names[joint] for name, joint in humanoid.items()}
    body = rig.character.body
    width = rig.character.head_width
    return {
        "path": rig.path,
        "joints": len(rig.joints.names),
        "joint names": list(rig.joints.names),
        "animated": rig.joints.animated,
        "animation": None if rig.joints.animation is None else str(rig.joints.animation.GetPath()),
        "moved by a rig bake": is_baked(rig),
        "samples": len(rig.joints.keys.every),
        "head": found.get("head"),
        "head found": humanoid.reasons.get("head"),
        "head width [m]": None if width is None else round(width, 3),
        "head height over ground [m]": _height(rig),
        "meshes": [str(m.prim.GetPath()) for m in rig.meshes],
        "body vertices": 0 if body is None else len(body.points),
        "blend shapes": [] if body is None else list(body.shapes),
        "mapping": found,
    }


def _chains(rig: StageRig, spoils: list[str], strands: bool) -> list[dict]:
    """Hair joints of rigged mesh hair; if there are none, notes on joints that may be, fewer if there are `strands`."""
    meshes = core_meshes(rig)
    try:
        with names_uneven_prims(rig):
            chains = assemble_rig(rig.character, meshes, of_bake(rig)).chains
        check_authored(rig.joints.prim)
        check_orients(rig, chains)
    except NoHairChains:
        spoils += unnamed_notes(rig, meshes, strands)
        return []
    except NeuralocksError as error:
        reason = str(error).removeprefix("skeleton: ").removeprefix(f"{rig.path}: ")
        spoils.append(f"{rig.path}: would stop a rig bake: {reason}")
        return []
    spoils += askew_notes(rig) + outside_notes(rig) + mirrored_notes(rig, chains)
    spoils += offset_notes(rig, chains) + left_out_notes(rig, meshes, chains)
    return describe_chains(chains)


def _how_baked(rig: StageRig) -> dict:
    """How hair bones were baked, if they were."""
    made = recorded(rig.joints.animation) if rig.joints.animation else {}
    return {"baked with": made} if made else {}


def _height(rig: StageRig) -> float | None:
    if "head" not in rig.character.humanoid:
        return None
    return round(float(rig.character.skeleton.bind[rig.character.head, 1, 3]), 3)


def _model(path: Path) -> dict:
    from neuralocks_core.models import model_file

    file = model_file.read(path)
    keep = ("format", "kind", "output", "anchored", "static", "training", "report", "credits")
    facts = {"model": {key: file.meta.get(key) for key in keep if key in file.meta}}
    if file.kind == "strands":
        from neuralocks_core.models.runtime import StrandModel

        facts["inputs of the body"] = StrandModel(file, threads=1).spec.size
    return facts | {"stops": [], "spoils": file.shortcomings()}


def _motion(path: Path) -> dict:
    from neuralocks_core.formats.bvh import read_bvh

    motion = read_bvh(path)
    clip = motion.clip
    facts = {
        "joints": len(motion.skeleton.names),
        "frames": len(clip.times),
        "seconds": round(clip.end - clip.start, 3),
        "unit [m]": motion.unit,
        "up axis": motion.up,
    }
    try:
        humanoid = Character(motion.skeleton).humanoid
    except NoHead:
        lacking = f"{path.name}: no joint is named like a head, so it moves no character; rename its joints"
        return facts | {"stops": [], "spoils": [lacking]}
    return facts | {"stops": [], "spoils": motion_notes(motion, clip.joints, humanoid)}
