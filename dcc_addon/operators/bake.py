# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake to USD, bake and attach, report card."""

import os
from pathlib import Path
from typing import NamedTuple

import bpy
from bpy.props import StringProperty

from neuralocks_core.errors import NeuralocksError

from ..bake_files import files_of, output_path, owner_of, shot_beside
from ..bake_groups import grouped
from ..live.live_strands import show_rest
from ..live.view import refresh
from ..scene.baked import attach
from ..scene.character.carried import hairs_of
from ..scene.character.riding import on_hair_bone
from ..scene.drawing.visibility import in_renders
from ..scene.export import write_shot
from ..scene.files.paths import check_own
from ..scene.hair import imported
from ..scene.hair.muting import on_top
from ..scene.objects.lookup import named
from ..services.panel.panel_errors import for_the_panel
from ..services.rigs.names import file_label
from ..services.work.overwriting import untaken
from ..services.work.temporary import temporary_folder
from ..services.work.threaded import Threaded, loading
from ..services.work.unfinished import undone_on_failure
from ..session import session
from .base import FILE_ONCE, Stepwise, sampling, shown_armature, shown_hair, tell


def frame_range(scene) -> tuple[int, int]:
    """First and last frame of the bake."""
    settings = scene.neuralocks
    if settings.use_scene_range:
        return scene.frame_start, scene.frame_end
    if settings.frame_end < settings.frame_start:
        raise NeuralocksError(
            f"Bake: the range ends at {settings.frame_end}, before {settings.frame_start}; set a later end"
        )
    return settings.frame_start, settings.frame_end


class Baked(NamedTuple):
    """What was baked.

    Attributes:
        hair: file and prim path by object name.
        notes: what an artist should know, in the words of the panel.
        prims: prim path by object name, of all that is in the shot.
        frames: first and last.
    """

    hair: dict[str, tuple[str, str]]
    notes: list[str]
    prims: dict[str, str]
    frames: tuple[int, int]


def bake_steps(context, armature, hairs, path: str, undrawn=(), attached: bool = False):
    """Sample, write the shot beside the bake, and bake it; yields (done, total, message), returns what was `Baked`.

    This calls the same functions as the command line, on a stage with the numbers of the live view. Hair with a name in `undrawn`
    is invisible in the file. If another character's hair is in the file, this one's gets another name. If the bake is to be
    `attached`, or hair plays its file already, it is made for Cycles.
    """
    scene = context.scene
    full = output_path(path)
    first, last = frame_range(scene)
    if not hairs:
        raise NeuralocksError(
            f"{armature.name_full}: no hair belongs to this character; attach a hair object in the panel"
        )
    on_bones = [problem for hair in hairs if (problem := on_hair_bone(hair))]
    if on_bones and attached:
        raise NeuralocksError(on_bones[0])
    looks, notes = grouped(hairs, undrawn)
    notes += on_bones
    notes += [f"{hair.name_full}: {doubt}" for hair in hairs if (doubt := imported.doubt(hair))]
    character, label, subframes = armature.name_full, file_label(armature.name), scene.neuralocks.subframes
    yield from loading("usd.baking.bake", "usd.assets.own_layers", "usd.assets.scene_writer")
    groups, kept = files_of(looks, Path(full), character, label)
    notes += kept
    outs = [out for out, _, _ in groups]
    # If hair has velocities, Cycles blurs it along straight lines, and leaves the samples between the frames unread.
    played = attached or any(attach.players(str(out)) for out in outs)
    options = {"frames": f"{first}:{last}", "subframes": subframes, "velocities": subframes == 1 or not played}
    sampled = yield from sampling(context, named(character), share=0.5)
    notes += [text for name, text in sampled.hairs_off.items() if any(name in names for _, _, names in groups)]
    baked: dict[str, tuple[str, str]] = {}
    written: dict[str, str] = {}
    with undone_on_failure(*outs, *map(shot_beside, outs)):
        for number, (out, look, names) in enumerate(groups):
            begin, end = (0.5 + 0.5 * (number + done) / len(looks) for done in (0, 1))
            own = [named(name) for name in names]
            prims = yield from write_shot(shot_beside(out), named(character), sampled, own, undrawn, begin, played)
            told = yield from _baking(out, look, begin, end, loop=sampled.clip.loop, **options)
            baked |= {name: (str(out), prims[name]) for name in names}
            written |= prims
            notes += [for_the_panel(sampled.rig.said(note), prims) for note in told]
    for out in outs:
        attach.renew(str(out), {name: prim for name, (_, prim) in baked.items()}, scene, (first, last))
    return Baked(baked, list(dict.fromkeys(notes)), written, (first, last))


def _baking(out: Path, look, begin: float, end: float, **options):
    """Steps, from share `begin` to `end` of the work, of baking the shot beside `out` with the sliders of a look; returns notes."""
    from usd.baking.bake import bake

    job = Threaded(
        lambda say: bake(
            shot_beside(out),
            out,
            look.model,
            material=list(look.material),
            strength=look.motion,
            resolve=look.resolve,
            **look.blowing._asdict(),
            progress=say,
            **options,
        )
    )
    result = yield from job.steps(begin, end)
    return result.notes


class NEURALOCKS_OT_bake(Stepwise, bpy.types.Operator):
    """Bake this character's moving hair to a USD layer, equal to the live view without modifiers. Its shot is written beside it as NAME_shot.usdc"""

    bl_idname = "neuralocks.bake"
    bl_label = "Bake to USD"
    bl_options = {"REGISTER"}

    filepath: StringProperty(name="File", description="USD file to write; if empty, the panel's output", **FILE_ONCE)

    def steps(self, context):
        armature = shown_armature(context)
        path = self.filepath or context.scene.neuralocks.output
        hairs = hairs_of(armature, context.scene)
        undrawn = [hair.name_full for hair in hairs if not in_renders(hair, context.scene)]
        baked, notes, *_ = yield from bake_steps(context, armature, hairs, path, undrawn)
        left = dict.fromkeys(f"'{modifier}'" for name in baked for modifier in on_top(named(name)))
        more = f"; not in the file: modifiers {', '.join(left)} (Bake and Attach plays below them)" if left else ""
        tell(self, f"Baked to {', '.join(sorted({out for out, _ in baked.values()}))}{more}", notes)


class NEURALOCKS_OT_bake_attach(Stepwise, bpy.types.Operator):
    """Bake the moving hair and put the cache back on the hair object, so that it plays and renders without this add-on"""

    bl_idname = "neuralocks.bake_attach"
    bl_label = "Bake and Attach"

    filepath: StringProperty(name="File", description="USD file to write; if empty, the panel's output", **FILE_ONCE)

    def steps(self, context):
        armature = shown_armature(context)
        hair = shown_hair(context, armature)
        attach.check_possible(hair)
        name, path = hair.name_full, Path(output_path(self.filepath or context.scene.neuralocks.output))
        character, label = armature.name_full, file_label(hair.name)
        yield from loading("usd.assets.own_layers")

        def taken(out: Path) -> bool:  # the panel's output is the same for all hair
            players = (thing.name_full for thing in attach.players(str(out)))
            return any(other != name for other in players) or owner_of(out, character) != ""

        path = untaken(path, label, taken)
        baked = yield from bake_steps(context, named(character), [named(name)], str(path), attached=True)
        hair = named(name)
        hair.neuralocks_hair.live = False
        attach.attach(hair, *baked.hair[name], context.scene, baked.frames)
        tell(self, f"{name}: now plays {baked.hair[name][0]}", baked.notes)


class NEURALOCKS_OT_detach(Stepwise, bpy.types.Operator):
    """Remove the baked cache from the hair object"""

    bl_idname = "neuralocks.detach"
    bl_label = "Remove Hair Cache"

    def steps(self, context):
        hair = shown_hair(context)
        check_own(hair)
        show_rest(hair)  # live hair also has modifiers off, and switches them off again at once
        found = attach.detach(hair)
        refresh(context.scene)
        yield 1, 1, ""
        return f"{hair.name_full}: cache removed" if found else f"{hair.name_full}: it has no cache"


class NEURALOCKS_OT_report(Stepwise, bpy.types.Operator):
    """Bake into a temporary folder and measure it: stretch, hair inside the body, motion, settling"""

    bl_idname = "neuralocks.report_card"
    bl_label = "Hair Report Card"
    bl_options = {"REGISTER"}

    def steps(self, context):
        armature = shown_armature(context)
        hair = shown_hair(context, armature)
        name = hair.name_full
        with temporary_folder() as folder:
            baked = yield from bake_steps(context, armature, [hair], os.path.join(folder, "card.usdc"))
            session.said.cards[name] = yield from _card(baked.hair[name][0], baked.prims)
        for line in session.said.cards[name]:
            self.report({"INFO"}, line)
        return f"{name}: report card made"


def _card(path: str, prims: dict[str, str]):
    """Steps of measuring a bake of the objects with these prims, by name; returns the lines of its card."""
    from ..services.panel.card import lines_of

    yield from loading("usd.review.evaluate")
    from usd.review.evaluate import evaluate

    measuring = Threaded(lambda say: evaluate(path, progress=say), "Measuring the hair")
    return [for_the_panel(line, prims) for line in lines_of((yield from measuring.steps()))]


CLASSES = (NEURALOCKS_OT_bake, NEURALOCKS_OT_bake_attach, NEURALOCKS_OT_detach, NEURALOCKS_OT_report)
