# SPDX-License-Identifier: GPL-3.0-or-later
"""What is saved in the file: settings of each hair object and of each character, and what the panel shows."""

import math

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from neuralocks_core.wind import STRONGEST

from .. import background
from ..live import view
from ..scene.files import named_from
from ..scene.files.paths import FILE
from ..services.panel.sliders import SLIDERS
from ..session import session

OVERRIDABLE = {"override": {"LIBRARY_OVERRIDABLE"}}
"""A choice made for a library override is saved with it."""
SETTING = {"options": set()} | OVERRIDABLE
"""Cannot be animated: hair of one frame remembers the motion before it, and a bake has one look."""
KEPT = {"options": {"HIDDEN"}} | OVERRIDABLE
"""Hidden from the artist."""


def _objects(kind: str) -> dict:
    """Arguments of a property that points to objects of this type."""
    return {"type": bpy.types.Object, "poll": lambda _self, candidate: candidate.type == kind}


def by_script(context) -> bool:
    """Whether a setting is changed by a script, which needs the result at once, and not in the sidebar."""
    return context.area is None or context.area.type not in {"VIEW_3D", "PROPERTIES"}


def _live_changed(hair_settings, context) -> None:
    view.strands_toggled(hair_settings.id_data, context.scene, wait=by_script(context))
    background.request()


def _carrier_changed(settings, context) -> None:
    _look_changed(settings, context)
    background.request()


def _look_changed(_settings, context) -> None:
    view.refresh(context.scene, wait=by_script(context))


def _rig_live_changed(character, context) -> None:
    view.rig_toggled(character.id_data, context.scene)
    background.request()


def _rig_look_changed(_character, context) -> None:
    view.refresh(context.scene)


def _rig_model_changed(character, context) -> None:
    named_from.remember([character.id_data])
    session.chains.pop(character.id_data.name_full, None)
    view.refresh(context.scene)


def _model_changed(settings, context) -> None:
    named_from.remember([settings.id_data])
    session.forget(settings.id_data.name_full)
    _look_changed(settings, context)


def _character_changed(settings, context) -> None:
    session.forget_motion(settings.id_data.name_full)


def _range_changed(_settings, context) -> None:
    view.refresh(context.scene)
    background.request()


def _loop_changed(character, context) -> None:
    view.loop_changed(character.id_data, context.scene)


class HairSettings(bpy.types.PropertyGroup):
    """The settings of a hair Curves object."""

    armature: PointerProperty(
        name="Armature",
        description="The rig whose head carries this hair",
        **_objects("ARMATURE"),
        update=_carrier_changed,
        **SETTING,
    )
    model: StringProperty(
        name="Model",
        description="Trained model file (*.neuralocks); empty means the one of those that come with the add-on that knows such hair best",
        **FILE,
        update=_model_changed,
        **OVERRIDABLE,
    )
    live: BoolProperty(
        name="Live",
        description="Move the hair with the character, at any frame and in renders",
        update=_live_changed,
        **SETTING,
    )
    resolve: BoolProperty(
        name="Keep out of Body",
        description="Push hair out of the body, live and in bakes",
        default=True,
        update=_look_changed,
        **SETTING,
    )
    shipped: StringProperty(description="Checksum of the add-on's model that moved this hair when it was saved", **KEPT)
    named_from: StringProperty(description="Folder of //, while this file is open", **KEPT)
    muted: StringProperty(description="Modifiers that are off while the hair is live, as JSON", **KEPT)
    replaced: StringProperty(description="Modifiers that are off while the hair plays a cache, as JSON", **KEPT)


for _slider in SLIDERS:
    HairSettings.__annotations__[_slider.name] = FloatProperty(
        name=_slider.label,
        description=_slider.description,
        default=1.0,
        min=_slider.low,
        max=_slider.high,
        soft_max=_slider.shown,
        subtype="FACTOR" if _slider.shown < _slider.high else "NONE",
        update=_look_changed,
        **SETTING,
    )


class CharacterSettings(bpy.types.PropertyGroup):
    """The settings of an armature object."""

    body: PointerProperty(
        name="Body",
        description="The skin mesh that the armature moves; found automatically if empty",
        **_objects("MESH"),
        update=_character_changed,
        **SETTING,
    )
    head_bone: StringProperty(
        name="Head Bone",
        description="The bone that carries the hair; found by name if empty",
        update=_character_changed,
        **SETTING,
    )
    loop: BoolProperty(
        name="Loop",
        description="The frame range repeats: its last frame shows the pose of its first, and hair on the first "
        "frame remembers the end of the range",
        update=_loop_changed,
        **SETTING,
    )
    wind: FloatProperty(
        name="Wind",
        description="How strongly a wind accelerates this character's hair, in m/s² (gravity is 9.81); 0 is a calm",
        default=0.0,
        min=0.0,
        max=STRONGEST,
        update=_look_changed,
        **SETTING,
    )
    wind_direction: FloatProperty(
        name="Direction",
        description="Where the wind blows to, seen from above: 0° is along the world's X axis, 90° along Y",
        subtype="ANGLE",
        default=0.0,
        min=-2 * math.pi,
        max=2 * math.pi,
        update=_look_changed,
        **SETTING,
    )
    gusts: FloatProperty(
        name="Gusts",
        description="Share by which the wind comes and goes",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_look_changed,
        **SETTING,
    )
    rig_model: StringProperty(
        name="Model",
        description="Trained model file for hair bones (*.neuralocks); empty means the one that comes with the add-on",
        **FILE,
        update=_rig_model_changed,
        **OVERRIDABLE,
    )
    rig_live: BoolProperty(
        name="Live",
        description="Turn the hair bones with the motion of the head",
        update=_rig_live_changed,
        **SETTING,
    )
    chains: StringProperty(
        name="Chains",
        description="Names of the first hair bones, separated by commas; * matches anything; found automatically if empty",
        update=_rig_model_changed,
        **SETTING,
    )
    named_from: StringProperty(description="Folder of //, while this file is open", **KEPT)
    rig_kept: StringProperty(description="Rotations of the hair bones from before they were live, as JSON", **KEPT)
    keys_kept: StringProperty(description="Rotations of the hair bones from before they were keyed, as JSON", **KEPT)
    keys_alone: StringProperty(
        description="How the armature's action was set before hair bones were keyed, as JSON",
        **KEPT,
    )
    rig_motion: FloatProperty(
        name="Motion",
        description="How much of the motion shows; type up to 2 to exaggerate it",
        default=1.0,
        min=0.0,
        max=2.0,
        soft_max=1.0,
        subtype="FACTOR",
        update=_rig_look_changed,
        **SETTING,
    )


class SceneSettings(bpy.types.PropertyGroup):
    """The settings of a scene: what the panel works on, and where bakes go."""

    armature: PointerProperty(name="Armature", description="The character shown in this panel", **_objects("ARMATURE"))
    hair: PointerProperty(name="Hair", description="The hair Curves object shown in this panel", **_objects("CURVES"))
    use_scene_range: BoolProperty(
        name="Scene Range", description="Bake the frames of the scene", default=True, update=_range_changed
    )
    frame_start: IntProperty(name="Start", description="First frame of the bake", default=1, update=_range_changed)
    frame_end: IntProperty(name="End", description="Last frame of the bake", default=250, update=_range_changed)
    subframes: IntProperty(
        name="Samples",
        description="Samples per frame: more than one for motion blur. If the shutter is open before the first "
        "frame, or after the last, bake one more frame there",
        default=1,
        min=1,
        max=16,
        update=_range_changed,
    )
    output: StringProperty(
        name="Output",
        description=(
            "Where the bake is written, with its shot beside it (NAME_shot.usdc); // is the folder of this file. If empty, there and "
            "named after this file"
        ),
        **FILE,
    )
    train_minutes: FloatProperty(
        name="Minutes",
        description=(
            "About how long a training takes. Strands start from what the shipped model has learned, so five minutes "
            "already help; hair bones start from nothing and take at least two; four are enough"
        ),
        default=15.0,
        min=0.05,
        max=720.0,
    )


CLASSES = (HairSettings, CharacterSettings, SceneSettings)


def attach() -> None:
    """Put the settings on Blender's types."""
    bpy.types.Object.neuralocks_hair = PointerProperty(type=HairSettings, **OVERRIDABLE)
    bpy.types.Object.neuralocks_character = PointerProperty(type=CharacterSettings, **OVERRIDABLE)
    bpy.types.Scene.neuralocks = PointerProperty(type=SceneSettings)


def detach() -> None:
    """Remove them again."""
    del bpy.types.Scene.neuralocks
    del bpy.types.Object.neuralocks_character
    del bpy.types.Object.neuralocks_hair
