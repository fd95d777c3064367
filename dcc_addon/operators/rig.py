# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigged hair: chains, keyframes, export."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import RigModel

from ..bake_files import output_path, owner_of, shot_beside
from ..live.character_wind import blowing
from ..live.live_rig import bind, rest, show_rest
from ..live.models import model_path
from ..live.view import refresh
from ..scene.baked import bone_record
from ..scene.drawing.clock import stretch_of
from ..scene.export import write_shot
from ..scene.files.paths import absolute, check_own
from ..scene.keys import hair_keys
from ..scene.objects.lookup import named
from ..services.hair.bones import LiveBones, chains_of, own_turns
from ..services.panel.panel_errors import for_the_panel
from ..services.rigs.motion import frame_numbers
from ..services.rigs.names import file_label
from ..services.work.overwriting import check_ours, untaken
from ..services.work.threaded import Threaded, loading
from ..services.work.unfinished import undone_on_failure
from ..session import session
from .bake import frame_range
from .base import FILE_ONCE, Hardened, Stepwise, sampled_once, sampling, shown_armature, tell


class NEURALOCKS_OT_find_chains(Stepwise, bpy.types.Operator):
    """Find the chains of hair bones below the head"""

    bl_idname = "neuralocks.find_chains"
    bl_label = "Find Hair Bones"
    bl_options = {"REGISTER"}

    def steps(self, context):
        armature = shown_armature(context)
        name, wanted = armature.name_full, armature.neuralocks_character.chains
        sampled = yield from sampled_once(context, armature)
        chains = chains_of(sampled.rig, sampled.character, wanted)
        lines = [
            f"{sampled.rig.said(chains.chain_name(i))}: {int((chains.chain == i).sum())} bones, {100 * chains.chain_length(i):.0f} cm"
            for i in range(len(chains.roots))
        ]
        session.said.cards[name] = lines
        return f"{name}: {len(chains)} hair bones in {len(lines)} chains"


class NEURALOCKS_OT_bake_keys(Stepwise, bpy.types.Operator):
    """Key only the hair bones, in a separate action on an NLA track; mute the track to get the old motion back"""

    bl_idname = "neuralocks.bake_keys"
    bl_label = "Bake Hair Bones to Keyframes"

    def steps(self, context):
        armature, scene = shown_armature(context), context.scene
        name = armature.name_full
        check_own(armature)
        first, last = frame_range(scene)
        hair_keys.check_heard(armature)
        try:
            show_rest(armature)
            with hair_keys.without(armature):
                sampled = yield from sampling(context, armature)
                armature = named(name)
                bones = bind(armature, sampled).bones
                hair_keys.check_mode_left(armature, bones.bones)
        finally:  # if the new keys cannot be made, earlier ones, and Live, stay as they were
            refresh(scene)
        frames = frame_numbers(first, last, scene.neuralocks.subframes)
        settings = armature.neuralocks_character
        turns = bones.turns(frames / sampled.motion.rate, settings.rig_motion, wind=blowing(armature).in_core())
        every = sampled.motion.frames
        own = own_turns(sampled.own, sampled.motion, bones.chains.joints, every)
        # Blender evaluates animation at stretched time.
        stretch = 1 / stretch_of(scene)
        settings.rig_live = False
        rest(armature)
        action = hair_keys.bake_keys(armature, bones.bones, (stretch * frames, turns), (stretch * every, own))
        bone_record.remember(action, armature, scene, (first, last))
        return f"{name}: {len(bones.bones)} hair bones keyed in '{action.name}'"


class NEURALOCKS_OT_remove_keys(Hardened, bpy.types.Operator):
    """Remove the baked keyframes of the hair bones"""

    bl_idname = "neuralocks.remove_keys"
    bl_label = "Remove Baked Hair Keys"

    def work(self, context):
        armature = shown_armature(context)
        check_own(armature)
        if not hair_keys.has_keys(armature):
            raise NeuralocksError(f"{armature.name_full}: it has no baked hair keys; bake them first")
        hair_keys.check_lasting(armature)
        show_rest(armature)  # what Live stored was turned by the keys; it now stores how the bones are without them
        library = hair_keys.remove(armature)
        refresh(context.scene)
        return f"{armature.name_full}: baked hair keys {f'of {library} muted here' if library else 'removed'}"


class NEURALOCKS_OT_export_skel(Stepwise, bpy.types.Operator):
    """Write the rig with moving hair bones as a USD skeleton animation. Its shot is written beside it as NAME_shot.usdc"""

    bl_idname = "neuralocks.export_skel"
    bl_label = "Export USD Animation"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="File", description="USD file to write; if empty, beside the panel's output", **FILE_ONCE
    )

    def steps(self, context):
        armature, scene = shown_armature(context), context.scene
        name, model = armature.name_full, model_path(armature, "rig")
        options, wind = {"strength": armature.neuralocks_character.rig_motion}, blowing(armature)
        out = Path(output_path(self.filepath or scene.neuralocks.output))
        if not self.filepath:
            out = out.with_name(f"{out.stem}_rig{out.suffix}")
        label = file_label(armature.name)
        yield from loading("usd.assets.own_layers", "usd.rig.bake", "usd.assets.scene_writer")
        from usd.assets.own_layers import is_own
        from usd.rig.bake import bake_rig

        out = untaken(out, label, lambda path: owner_of(path, name))
        shot = shot_beside(out)
        check_ours([out, shot], is_own)
        sampled = yield from sampling(context, named(name), share=0.5)
        bones = bind(named(name), sampled).bones  # reports what is wrong before anything is written
        if bones.model.feels_wind:
            options |= wind._asdict()
        head, loop = sampled.character.skeleton.names[sampled.character.head], sampled.clip.loop
        with undone_on_failure(out, shot):
            prims = yield from write_shot(shot, named(name), sampled, [], share=0.5)
            job = Threaded(
                lambda say: bake_rig(shot, out, model, head=head, loop=loop, **options, progress=say),
                "Baking the hair bones",
            )
            result = yield from job.steps(0.5)
        notes = [for_the_panel(sampled.rig.said(note), prims) for note in result.notes]
        tell(self, f"{name}: hair bones written to {out}", notes)


class NEURALOCKS_OT_export_c(Stepwise, bpy.types.Operator):
    """Write the model of the hair bones as a C header for a game engine, with a worked example beside it, NAME_example.c"""

    bl_idname = "neuralocks.export_c"
    bl_label = "Export C Header"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="File",
        description="Header to write; if empty, beside this file and named after the character",
        **FILE_ONCE,
    )

    def steps(self, context):
        from neuralocks_core.rig.export_c import example_beside, export_c, made_here

        armature = shown_armature(context)
        path = self.filepath.strip() or f"//{file_label(armature.name)}_hair.h"
        out = Path(absolute(path))
        if out.is_dir():
            raise NeuralocksError(f"{path}: this is a folder; name a header file in it")
        model = RigModel.load(model_path(armature, "rig"))
        check_ours([out, example_beside(out)], made_here)
        sampled = yield from sampled_once(context, armature)
        # Reports if the model belongs to another rig, as the shipped one does.
        LiveBones.of(model, sampled.rig, sampled.character)
        export_c(model, out)
        return f"C header written to {out}"


CLASSES = (
    NEURALOCKS_OT_find_chains,
    NEURALOCKS_OT_bake_keys,
    NEURALOCKS_OT_remove_keys,
    NEURALOCKS_OT_export_skel,
    NEURALOCKS_OT_export_c,
)
