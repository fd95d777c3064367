# SPDX-License-Identifier: Apache-2.0
"""Bake: a shot with a groom in, an override layer with moving hair out."""

import hashlib
import time
from collections.abc import Callable
from dataclasses import asdict

from neuralocks_core.arguments import flag
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.materials import Material
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.progress import Progress
from neuralocks_core.wind import check_felt

from ..border.amounts import check_number
from ..border.stage_files import check_layer_name
from ..shot.bakes.bake_record import given_facts
from ..shot.stage import StageGroom
from ..shot.wind import as_wind, in_core, wind_facts
from .groom_models import GroomModels
from .model_notes import learned, model_notes
from .points.posing import GroomPoser
from .procedure import BakeResult, known_notes, read_asked, write_told
from .samples import write_samples

RECORDED = 12
"""Letters of a model's digest that a bake records."""


def bake(
    shot,
    out,
    model=None,
    *,
    grooms=None,
    skeleton: str | None = None,
    head: str | None = None,
    frames=None,
    joints: dict[str, str] | None = None,
    subframes: int = 1,
    material=None,
    strength: float = 1.0,
    wind=None,
    gusts: float | None = None,
    resolve: bool = True,
    loop: bool = False,
    cuts=None,
    velocities: bool = True,
    jobs: int | None = None,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> BakeResult:
    """Bake moving hair.

    Args:
        shot: path of a USD stage, or a `Shot` already read, with its grooms, skeletons, joints and cuts.
        out: `.usdc`, `.usd` or `.usda` to write.
        model: path of a strand model, or a StrandModel; if left out, the shipped one that suits each groom.
        grooms: prim paths; all grooms if left out.
        skeleton: prim path of the skeleton; found if left out.
        head: joint that carries the grooms that no binding assigns to a joint.
        frames: `FIRST:LAST[:STEP]`, or time codes in any order; the shot's range if left out.
        joints: semantic joint -> joint (path, or its last part), if names are not enough.
        subframes: samples per frame, for motion blur.
        material: a Material, words NAME=VALUE such as "bend=2x", or a dict of them: {"bend": "2x"}.
        strength: motion strength from 0 (each pose as if held) to 4; 1 is as trained.
        wind: acceleration of all hair by a wind, three numbers in the stage's axes [m/s^2]; see `neuralocks_core.wind`.
        gusts: share of it by which it varies, 0.5 if left out.
        resolve: push hair out of the body after the network.
        loop: the clip repeats, and its last sample shows the pose of its first: at the start, hair remembers the end of the clip.
        cuts: time codes at which a character is suddenly elsewhere and its hair starts anew; [] if there are none, detected if None.
        velocities: write velocities.
        jobs: threads; if left out, a StrandModel's own, else one per core, eight at most.
        tell: called with the notes known before hair is posed, then with the others.
        progress: called with (done, total, message); raising from it stops the bake.

    Raises:
        NeuralocksError: what cannot be baked, in one line. Nothing is left under the output's name.
    """
    began = time.monotonic()
    out = as_path(out, "out")
    check_layer_name(out)
    resolve, loop, velocities = flag("--resolve", resolve), flag("--loop", loop), flag("--velocities", velocities)
    if jobs is not None:
        check_number("--jobs", jobs, 1, 1024, whole=True)
    groom_models = GroomModels(model, jobs)
    look = as_material(material)
    check_number("--strength", strength, 0, 4)
    blown = as_wind(wind, gusts)
    check_felt(blown is None or groom_models.asked.feels_wind)
    reading = {"grooms": grooms, "skeleton": skeleton, "head": head, "joints": joints}
    shot, codes = read_asked(shot, reading, cuts, loop, frames, subframes, blown, progress)
    options = {"strength": float(strength), "resolve": resolve, "loop": loop}
    models = groom_models.each(shot.grooms)
    digests = {item.path: digest_of(each) for each, items in models for item in items}
    inputs = {"models": digests, "material": asdict(look), "wind": blown and asdict(blown)}

    def poser(items: list[StageGroom]) -> GroomPoser:
        return GroomPoser(items, groom_models.of(items[0]), look, wind=in_core(blown, shot.border), **options)

    alike = {"material": asdict(look), **options, **wind_facts(blown)}

    def facts(item: StageGroom) -> dict:
        given = given_facts(shot.given_cuts(item.attachment.rig), shot.joints)
        return {"model": digests[item.path][:RECORDED], **alike, **given}

    moved = [(each, [item.attachment for item in items]) for each, items in models]
    untrue = {note for each in moved for note in learned(*each)}
    known = known_notes(shot, codes, loop, bool(groom_models.asked.spec.bins))
    notes = [
        *(note for note in known if note not in untrue),
        *dict.fromkeys(note for each, its in moved for note in model_notes(each, look, its, strength)),
    ]

    def write() -> int:
        how = {
            "moved_by": groom_models.path,
            "velocities": velocities,
            "blown": blown is not None,
            "progress": progress,
        }
        return write_samples(shot, out, codes, poser, inputs | options, facts, **how)

    result = write_told(notes, tell, began, shot, out, codes, write)
    for told, item in zip(result.grooms, shot.grooms, strict=True):
        told["model"] = groom_models.path(item).stem
    return result


def as_material(material) -> Material:
    """A Material from a Material, from words NAME=VALUE, or from a dict of them.

    Raises:
        NeuralocksError: it is something else, or a word is not one of `Material.parse`.
    """
    if isinstance(material, Material):
        return material
    if isinstance(material, dict):
        material = [f"{name}={value}" for name, value in material.items()]
    words = [material] if isinstance(material, str) else material or ()
    if not isinstance(words, list | tuple) or not all(isinstance(word, str) for word in words):
        raise NeuralocksError(
            f"material: {material!r} is not one; give a Material, words such as 'bend=2x', or a dict of them"
        )
    return Material.parse(words)


def digest_of(model: StrandModel) -> str:
    """A number of a model's card and graphs, of which a bake records the first RECORDED letters."""
    digest = hashlib.sha256(repr(sorted(model.file.meta.items(), key=str)).encode())
    for name in model_file.KINDS["strands"]:
        digest.update(model.file.graphs[name])
    return digest.hexdigest()
