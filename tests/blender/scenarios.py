# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold inside a real Blender, one function a scenario; each begins with an empty scene and the add-on
enabled.
"""

import os
from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes

MODEL = os.environ.get("NEURALOCKS_TEST_MODEL", "")
SAME = 1e-5


def _live(rig, strands, **look):
    """Make the hair live on a sampled rig."""
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    strands.neuralocks_hair.armature = rig
    strands.neuralocks_hair.model = MODEL
    for name, value in look.items():
        setattr(strands.neuralocks_hair, name, value)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    strands.neuralocks_hair.live = True


def _messages():
    from dcc_addon.session import session

    return session.messages


def _at(strands, frame, subframe=0.0):
    bpy.context.scene.frame_set(frame, subframe=subframe)
    return scenes.points(strands)


def _baked(path, prim, frame):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(prim))
    points = np.array(curves.GetPointsAttr().Get(frame), float)
    matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(curves.GetPrim())).T
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def _apart(a, b):
    assert a.shape == b.shape
    return float(np.abs(a - b).max())


def _handlers():
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    return [
        f for calls in lists if isinstance(calls, list) for f in calls if "dcc_addon" in getattr(f, "__module__", "")
    ]


def lifecycle(folder: Path) -> None:
    """Enable, disable, enable, load another file: nothing is left behind, nothing is there twice."""
    import dcc_addon

    before = len(_handlers())
    assert before > 5
    dcc_addon.unregister()
    assert not _handlers()
    assert not [n for n in dir(bpy.types) if n.startswith("NEURALOCKS_")]
    assert not hasattr(bpy.types.Object, "neuralocks_hair")
    dcc_addon.register()
    assert len(_handlers()) == before
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "empty.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "empty.blend"))
    assert len(_handlers()) == before
    dcc_addon.unregister()
    assert not _handlers()


def one_result(folder: Path) -> None:
    """Live view, operator and Python call give the same points, with IK, constraints, drivers and moved objects in
    the rig.
    """
    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    scenes.constrain(rig)
    strands = scenes.hair(rig, 80)
    strands.scale = (1.2, 1.0, 0.8)  # unapplied
    _live(rig, strands, bend=2.0, weight=1.3, motion=0.8)
    scene = bpy.context.scene
    rng = np.random.default_rng(0)
    frames = [int(f) for f in rng.permutation(np.arange(1, 25))]
    shown = {f: _at(strands, f) for f in frames}
    for f in frames[::-1]:
        assert _apart(_at(strands, f), shown[f]) == 0.0, "scrubbing back changes the hair"
    assert _apart(shown[1], shown[12]) > 0.01
    assert not _messages(), _messages()

    assert bpy.ops.neuralocks.bake(filepath=str(folder / "bake.usdc")) == {"FINISHED"}
    for f in frames:
        assert _apart(_baked(folder / "bake.usdc", "/Character/Hair_Hair", f), shown[f]) < SAME

    from usd.bake import bake

    words = ["bend=2x", "weight=1.3x", "damping=1x", "clumping=1x"]
    bake(folder / "bake_shot.usdc", folder / "again.usdc", MODEL, material=words, strength=0.8)
    for f in frames[:6]:
        a, b = (_baked(folder / name, "/Character/Hair_Hair", f) for name in ("bake.usdc", "again.usdc"))
        assert _apart(a, b) < SAME, (f, _apart(a, b))
    assert scene.frame_current == frames[0]
    assert skin.name in bpy.data.objects


def out_of_the_body(folder: Path) -> None:
    """Keep out of Body and a looped range: live equals the bake, and each makes a difference."""
    rig = scenes.armature()
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 60, length=0.4)
    _live(rig, strands, resolve=False)
    free = {f: _at(strands, f) for f in (2, 13, 24)}
    strands.neuralocks_hair.resolve = True
    shown = {f: _at(strands, f) for f in (13, 2, 24)}
    assert not _messages(), _messages()
    assert max(_apart(free[f], shown[f]) for f in free) > 1e-4, "no hair was in the body"
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "out.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert _apart(_baked(folder / "out.usdc", "/Character/Hair_Hair", f), points) < SAME

    strands.neuralocks_hair.resolve = False
    assert _apart(_at(strands, 2), free[2]) == 0.0
    rig.neuralocks_character.loop = True
    shown = {f: _at(strands, f) for f in (2, 13, 24)}
    assert _apart(free[2], shown[2]) > 1e-4, "the second frame must remember the end of the range"
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "loop.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert _apart(_baked(folder / "loop.usdc", "/Character/Hair_Hair", f), points) < SAME
    rig.neuralocks_character.loop = False
    assert _apart(_at(strands, 2), free[2]) == 0.0


def blender_export(folder: Path) -> None:
    """A bake of the scene as Blender itself exports it equals the live view."""
    if not hasattr(bpy.ops.wm, "usd_export") or not getattr(bpy.app.build_options, "usd", False):
        print("no USD in this Blender")
        return
    rig = scenes.armature()
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 40)
    _live(rig, strands)
    shown = {f: _at(strands, f) for f in (2, 13, 24)}
    strands.neuralocks_hair.live = False
    bpy.context.scene.frame_set(1)
    shot = folder / "scene.usdc"
    bpy.ops.wm.usd_export(filepath=str(shot), export_animation=True, export_armatures=True, export_materials=False)
    from pxr import Usd, UsdGeom

    from usd.bake import bake

    bake(shot, folder / "baked.usdc", MODEL)
    stage = Usd.Stage.Open(str(folder / "baked.usdc"))
    prim = next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves))
    for f, points in shown.items():
        apart = _apart(_baked(folder / "baked.usdc", str(prim.GetPath()), f), points)
        print(f, apart)
        assert apart < SAME


def rest_is_safe(folder: Path) -> None:
    """Live off, the add-on off, or a file opened without it: the hair is as it was groomed."""
    import dcc_addon

    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 50)
    groomed = np.array([p.position for p in strands.data.points])
    _live(rig, strands)
    moved = _at(strands, 14)

    def own():
        return np.array([p.position for p in bpy.data.objects["Hair"].data.points])

    assert _apart(own(), groomed) > 1e-3

    file = folder / "live.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    assert _apart(scenes.points(strands), moved) < 1e-6, "saving must not disturb the view"
    dcc_addon.unregister()
    assert _apart(own(), groomed) == 0.0
    bpy.ops.wm.open_mainfile(filepath=str(file))
    assert _apart(own(), groomed) == 0.0
    assert "neuralocks_rest" not in bpy.data.objects["Hair"].data.attributes

    dcc_addon.register()
    strands, rig = bpy.data.objects["Hair"], bpy.data.objects["Rig"]
    assert strands.neuralocks_hair.live
    bpy.context.scene.neuralocks.armature = rig
    bpy.ops.neuralocks.sample_motion()
    assert _apart(_at(strands, 14), moved) < 1e-6
    strands.neuralocks_hair.live = False
    assert _apart(own(), groomed) == 0.0


def posing(folder: Path) -> None:
    """The hair follows a pose made by hand without a frame change; edited animation is noticed and sampled again."""
    from dcc_addon.session import session

    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 50)
    _live(rig, strands)
    before = _at(strands, 9)
    rig.pose.bones["head"].rotation_euler[1] += 0.5
    bpy.context.view_layer.update()
    bpy.context.view_layer.update()
    posed = scenes.points(strands)
    assert _apart(posed, before) > 0.02
    assert _apart(_at(strands, 9), before) < 1e-6, "the pose was not keyed, so the frame brings the animated one back"
    assert not session.rigs["Rig"].stale

    rig.pose.bones["head"].rotation_euler[1] += 0.5
    rig.pose.bones["head"].keyframe_insert("rotation_euler", frame=9)
    _at(strands, 8)
    assert session.rigs["Rig"].stale
    bpy.ops.neuralocks.sample_motion()
    assert not session.rigs["Rig"].stale
    after = _at(strands, 9)
    assert _apart(after, before) > 0.02
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "b.usdc")) == {"FINISHED"}
    assert _apart(_baked(folder / "b.usdc", "/Character/Hair_Hair", 9), after) < SAME


def rendering(folder: Path) -> None:
    """A final render sees the hair of the viewport, frame by frame, and samples what is out of date."""
    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 30)
    _live(rig, strands)
    shown = {f: _at(strands, f) for f in (3, 4, 5)}
    scene = bpy.context.scene
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "CYCLES", 16, 16
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.frame_start, scene.frame_end = 3, 5
    scene.render.filepath = str(folder / "r_")
    rendered = {}

    def look(current, graph):
        if graph.mode == "RENDER":
            values = np.empty((len(strands.data.points), 3), np.float32)
            strands.data.attributes["position"].data.foreach_get("vector", values.ravel())
            matrix = np.array(strands.evaluated_get(graph).matrix_world)
            rendered[current.frame_current] = values @ matrix[:3, :3].T + matrix[:3, 3]

    bpy.app.handlers.frame_change_post.append(look)  # called after the add-on's own
    scene.frame_set(20)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.frame_change_post.remove(look)
    assert sorted(rendered) == [3, 4, 5]
    for f, points in rendered.items():
        assert _apart(_at(strands, f), points) < SAME
    # The range was shortened before the render, so it had to sample anew: the run-up of frames 1 and 2 is gone.
    assert max(_apart(rendered[f], shown[f]) for f in shown) > SAME
    rig.pose.bones["head"].rotation_euler[0] += 0.4
    rig.pose.bones["head"].keyframe_insert("rotation_euler", frame=4)
    scene.frame_set(4)
    bpy.ops.render.render()
    after = scenes.points(strands)
    bpy.ops.neuralocks.sample_motion()
    assert _apart(_at(strands, 4), after) < SAME, "the render used a motion that was out of date"


def two_characters(_folder: Path) -> None:
    """Both live, each with its own hair; deleting one leaves the other alive and the hair at rest."""
    first, second = scenes.armature("Anna"), scenes.armature("Ben")
    scenes.dance(first)
    scenes.dance(second)
    for curve in scenes.fcurves(second):
        for key in curve.keyframe_points:
            key.co[1] *= -0.7
    one, two = scenes.hair(first, 20, name="One"), scenes.hair(second, 30, name="Two")
    groomed = np.array([p.position for p in two.data.points])
    _live(first, one)
    _live(second, two)
    a, b = _at(one, 12), _at(two, 12)
    assert len(a) != len(b)
    bpy.data.objects.remove(second)
    bpy.context.view_layer.update()
    assert _apart(_at(one, 12), a) < 1e-6
    _at(one, 13)
    assert "Two" in _messages() and "armature" in _messages()["Two"]
    assert _apart(np.array([p.position for p in two.data.points]), groomed) == 0.0


def attached(folder: Path) -> None:
    """Bake and Attach: the cache on the hair object shows what was live, without the add-on."""
    import dcc_addon

    if not getattr(bpy.app.build_options, "usd", False):
        scenes_only = bpy.ops.neuralocks
        assert scenes_only
        return
    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 40)
    _live(rig, strands)
    shown = {f: _at(strands, f) for f in (1, 8, 17, 24)}
    assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "cache.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert _apart(_at(strands, f), points) < SAME
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "farm.blend"))
    dcc_addon.unregister()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "farm.blend"))
    for f, points in shown.items():
        assert _apart(_at(bpy.data.objects["Hair"], f), points) < SAME


def bones(folder: Path) -> None:
    """Hair bones: live equals baked keys; keys on exactly these bones, in an action of their own that can be muted."""
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    before = {c.data_path: len(c.keyframe_points) for c in scenes.fcurves(rig)}
    scene = bpy.context.scene
    scene.neuralocks.armature = rig
    assert bpy.ops.neuralocks.find_chains() == {"FINISHED"}
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}

    def turns(frame):
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        pose = rig.evaluated_get(graph).pose
        return np.array([np.array(bone.matrix) for bone in pose.bones])

    still = {f: turns(f) for f in (3, 11, 24)}
    rig.neuralocks_character.rig_live = True
    live = {f: turns(f) for f in (24, 3, 11)}
    assert not _messages(), _messages()
    hair = [i for i, b in enumerate(rig.pose.bones) if b.name.startswith("hair")]
    others = [i for i in range(len(rig.pose.bones)) if i not in hair]
    for f in still:
        assert _apart(live[f][others], still[f][others]) < 1e-6
        assert _apart(live[f][hair], still[f][hair]) > 1e-3
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    for f in still:
        assert _apart(turns(f), live[f]) < SAME
    assert {c.data_path: len(c.keyframe_points) for c in scenes.fcurves(rig)} == before, "other keys were touched"
    track = rig.animation_data.nla_tracks["Neuralocks Hair"]
    keyed = {c.data_path.split('"')[1] for c in scenes.fcurves_of(track.strips[0].action)}
    assert keyed == {"hair.01", "hair.02"}, keyed
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}

    assert bpy.ops.neuralocks.export_skel(filepath=str(folder / "skel.usdc")) == {"FINISHED"}
    from usd.stage import read_rigs

    written = read_rigs(folder / "skel.usdc")[0]
    leaves = [name.split("/")[-1] for name in written.character.skeleton.names]
    order = [leaves.index(bone.name.replace(".", "_")) for bone in rig.pose.bones]
    z_up = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for f in live:
        scene.frame_set(f)
        joints = written.joints_at(f)[order]
        place = np.array(rig.matrix_world)
        world = place @ live[f]
        assert _apart(z_up @ joints[:, :3, :3], world[:, :3, :3]) < SAME
        assert _apart(joints[:, :3, 3] @ z_up.T, world[:, :3, 3]) < SAME
    assert bpy.ops.neuralocks.export_c(filepath=str(folder / "hair.h")) == {"FINISHED"}
    assert "hair_02" in (folder / "hair.h").read_text()
    for f in still:
        assert _apart(turns(f)[others], still[f][others]) < 1e-6


def particles(_folder: Path) -> None:
    """Particle hair becomes Curves with all its keys, on the head."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0, 0, 1.6))
    ball = bpy.context.active_object
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length, settings.hair_step = "HAIR", 40, 0.2, 7
    bpy.context.view_layer.update()
    assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
    strands = bpy.context.scene.neuralocks.hair
    assert len(strands.data.curves) == 40 and len(strands.data.points) == 40 * 8
    points = scenes.points(strands).reshape(40, 8, 3)
    away = np.linalg.norm(points - [0, 0, 1.6], axis=2)
    assert np.abs(away[:, 0] - 0.1).max() < 2e-3 and (away[:, -1] > 0.25).all()


def bad_input(folder: Path) -> None:
    """Each in plain words, no traceback, nothing lost."""
    operators, scene = bpy.ops.neuralocks, bpy.context.scene

    def refused(call, *words):
        try:
            result = call()
        except RuntimeError as error:
            text = str(error)
            assert "unexpected" not in text, text
            assert all(word in text for word in words), text
        else:
            raise AssertionError(f"not refused: {result}")

    refused(operators.find, "no armature")
    refused(operators.sample_motion, "no armature")
    refused(operators.bake, "no armature")
    refused(operators.from_particles, "particle system")
    headless = scenes.armature("Snake", (("a", "", (0, 0, 0), (0, 0, 1)), ("b", "a", (0, 0, 1), (0, 0, 2))))
    scene.neuralocks.armature = headless
    refused(operators.sample_motion, "Snake", "head")
    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 10)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    own = strands.neuralocks_hair
    own.model = MODEL
    refused(lambda: operators.bake(filepath="//x.usdc"), "not saved")
    refused(lambda: operators.bake(filepath="/proc/nowhere/x.usdc"), "/proc/nowhere")

    assert operators.sample_motion() == {"FINISHED"}
    groomed = scenes.points(strands)
    (folder / "torn.neuralocks").write_bytes(Path(MODEL).read_bytes()[:5000])
    for path, word in (
        ("/nowhere.neuralocks", "no such"),
        (str(folder / "torn.neuralocks"), "damaged"),
        ("//m.neuralocks", "not saved"),
    ):
        own.model = path
        own.live = True
        scene.frame_set(7)
        assert word in _messages()["Hair"], _messages()
        assert _apart(scenes.points(strands), scenes.points(strands)) == 0.0
        own.live = False
    scene.frame_set(1)
    assert _apart(scenes.points(strands), groomed) < 1e-6
    own.model = MODEL

    for name, counts in (("Empty", []), ("Dots", [1, 1, 1])):
        bad = bpy.data.objects.new(name, bpy.data.hair_curves.new(name))
        if counts and hasattr(bad.data, "add_curves"):
            bad.data.add_curves(counts)
        scene.collection.objects.link(bad)
        bad.neuralocks_hair.armature, bad.neuralocks_hair.model = rig, MODEL
        operators.sample_motion()
        bad.neuralocks_hair.live = True
        scene.frame_set(5)
        assert name in _messages(), name
        bad.neuralocks_hair.live = False
        bpy.data.objects.remove(bad)

    operators.sample_motion()
    own.live = True
    rig.scale = (-1, 1, 1)
    refused(operators.sample_motion, "mirrored")
    rig.scale = (1, 1, 1)
    scene.frame_start = scene.frame_end = 4
    assert operators.sample_motion() == {"FINISHED"}
    assert operators.bake(filepath=str(folder / "one.usdc")) == {"FINISHED"}
    scene.frame_set(4)
    assert _apart(_baked(folder / "one.usdc", "/Character/Hair_Hair", 4), scenes.points(strands)) < SAME
    away = bpy.data.collections.new("Away")
    scene.collection.children.link(away)
    away.objects.link(rig)
    scene.collection.objects.unlink(rig)
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    assert operators.sample_motion() == {"FINISHED"}, "what is excluded is still evaluated, as the hair depends on it"
    scene.frame_set(4)
    assert not _messages(), _messages()


def bad_hair(folder: Path) -> None:
    """Hair and models that cannot be live say why, and what is deleted or hidden meanwhile takes nothing along."""
    import zipfile

    from dcc_addon.scene.sampling import sample
    from neuralocks_core.errors import NeuralocksError

    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    strands, other = scenes.hair(rig, 20), scenes.hair(rig, 20, name="Other")
    scene = bpy.context.scene

    later = folder / "later.neuralocks"
    with zipfile.ZipFile(MODEL) as old, zipfile.ZipFile(later, "w") as new:
        for item in old.infolist():
            data = old.read(item)
            new.writestr(item, data.replace(b'"format": 1', b'"format": 99') if item.filename == "model.json" else data)
    _live(rig, strands)
    groomed = np.array([p.position for p in other.data.points])
    _at(strands, 7)
    strands.neuralocks_hair.model = str(later)
    assert "99" in _messages()["Hair"], _messages()
    strands.neuralocks_hair.model = MODEL
    assert not _messages(), _messages()

    first = other.data.points[0].position.copy()
    other.data.points[0].position = (float("nan"), 0, 0)
    other.neuralocks_hair.model = MODEL
    other.neuralocks_hair.live = True
    assert "finite" in _messages()["Other"], _messages()
    other.data.points[0].position = first
    other.neuralocks_hair.live = False
    assert _apart(np.array([p.position for p in other.data.points]), groomed) == 0.0

    # Hair in an excluded collection while the motion is sampled, and shown afterwards.
    away = bpy.data.collections.new("Away")
    scene.collection.children.link(away)
    away.objects.link(other)
    scene.collection.objects.unlink(other)
    layer = bpy.context.view_layer.layer_collection.children["Away"]
    other.location, other.rotation_euler, other.scale = (0.1, 0.2, 0.0), (0.1, 0.2, 0.4), (1.5, 0.7, -1.0)
    bpy.context.view_layer.update()
    layer.exclude = True
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    scene.frame_set(17)
    layer.exclude = False
    other.neuralocks_hair.live = True
    shown = _at(other, 9)
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert _apart(_at(other, 9), shown) < SAME
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "away.usdc")) == {"FINISHED"}
    assert _apart(_baked(folder / "away.usdc", "/Character/Hair_Other", 9), shown) < SAME

    steps = sample(bpy.context, rig)
    next(steps)
    bpy.data.objects.remove(skin)
    try:
        list(steps)
    except NeuralocksError as error:
        assert "deleted" in str(error), error
    else:
        raise AssertionError("the body was deleted half way")
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    _at(strands, 3)
    bpy.data.objects.remove(other)
    _at(strands, 4)
    assert not _messages(), _messages()
    rig.name, strands.name = "Renamed", "Locks"
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    _at(strands, 5)
    assert not _messages(), _messages()


def ways_of_parenting(folder: Path) -> None:
    """Hair parented to the armature, to its head bone, or grown on a deformed surface moves in the same way."""
    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    scene = bpy.context.scene
    by_object = scenes.hair(rig, 30, name="ByObject")
    by_bone = scenes.hair(rig, 30, name="ByBone")
    rest = rig.data.bones["head"]
    by_bone.parent_type, by_bone.parent_bone = "BONE", "head"
    # Bone parents count from the bone's tail.
    tail = rest.matrix_local @ scenes.translation((0, rest.length, 0))
    by_bone.matrix_parent_inverse = tail.inverted()
    on_surface = scenes.hair(rig, 30, name="OnSurface")
    on_surface.parent = skin
    on_surface.data.surface = skin
    deform = scenes.surface_deform(on_surface)
    scene.neuralocks.armature = rig
    for hair in (by_object, by_bone, on_surface):
        hair.neuralocks_hair.model = MODEL
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for hair in (by_object, by_bone, on_surface):
        hair.neuralocks_hair.live = True
    assert not deform.show_viewport and not deform.show_render
    for frame in (1, 9, 22):
        scene.frame_set(frame)
        assert not _messages(), _messages()
        points = {h.name: scenes.points(h) for h in (by_object, by_bone, on_surface)}
        assert _apart(points["ByBone"], points["ByObject"]) < SAME
        assert _apart(points["OnSurface"], points["ByObject"]) < SAME
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "three.usdc")) == {"FINISHED"}
    for name, shown in points.items():
        assert _apart(_baked(folder / "three.usdc", f"/Character/Hair_{name}", 22), shown) < SAME
    on_surface.neuralocks_hair.live = False
    assert deform.show_viewport and deform.show_render


def training(folder: Path) -> None:
    """Train: in another process, its model goes to the hair that it was trained for; a second one at once is refused."""
    import shutil
    import sys
    import time

    from dcc_addon.operators import training as operator
    from dcc_addon.services import training_job

    child = folder / "child.py"
    child.write_text(
        "import json, shutil, sys, time\n"
        "if '--check' not in sys.argv:\n"
        "    settings = json.load(sys.stdin)\n"
        "    assert open(settings['character'], 'rb').read(8) == b'PXR-USDC'\n"
        "    print(json.dumps({'done': 0.5, 'message': 'half'}), flush=True)\n"
        "    time.sleep(1)\n"
        f"    shutil.copy({MODEL!r}, settings['out'])\n"
    )
    training_job.CHILD = child
    operator.training_python = lambda: shutil.which("python3") or sys.executable
    rig = scenes.armature()
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    bpy.context.scene.neuralocks.armature, bpy.context.scene.neuralocks.hair = rig, strands
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "train.blend"))
    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    try:
        bpy.ops.neuralocks.train()
    except RuntimeError as error:
        assert "one is running already" in str(error)
    else:
        raise AssertionError("two trainings at a time")
    end = time.monotonic() + 60
    while operator.finish() is None and time.monotonic() < end:
        time.sleep(0.1)
    assert "trained" in _messages()["training"], _messages()
    assert Path(strands.neuralocks_hair.model).parent == folder
    strands.neuralocks_hair.live = True
    bpy.context.scene.frame_set(9)
    assert "Hair" not in _messages(), _messages()


def trained_for_real(folder: Path) -> None:
    """Train from the panel's own operator in a real second Python, with progress, cancel, and a model at the end."""
    import time

    from dcc_addon.operators import training as operator
    from dcc_addon.services.training_job import problem

    trouble = problem(operator.training_python())
    if trouble:
        print(trouble)
        return
    rig = scenes.armature()
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 40)
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    scene.neuralocks.train_minutes = 0.05
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "train.blend"))

    def wait(until, seconds):
        end = time.monotonic() + seconds
        while not until():
            assert time.monotonic() < end, operator.job() and (operator.job().message, operator.job().failure())
            time.sleep(0.2)

    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    running = operator.job()
    wait(lambda: running.message not in ("Starting",), 120)
    assert bpy.ops.neuralocks.cancel_training() == {"FINISHED"}
    assert operator.job() is None and not running.running and not running.succeeded
    assert not list(folder.glob("*.neuralocks")), "a cancelled training leaves no model"

    assert bpy.ops.neuralocks.train() == {"FINISHED"}
    running, said, shares = operator.job(), set(), []

    def follow():
        said.add(running.message)
        shares.append(running.done)
        return operator.finish() is not None

    wait(follow, 400)
    print(sorted(said))
    assert "trained" in _messages()["training"], _messages()
    assert len(said) > 3 and shares == sorted(shares)
    assert Path(strands.neuralocks_hair.model).parent == folder and Path(strands.neuralocks_hair.model).exists()
    strands.neuralocks_hair.live = True
    scene.frame_set(9)
    assert "Hair" not in _messages(), _messages()
    assert "neuralocks_rest" in strands.data.attributes


def undo(folder: Path) -> None:
    """Undo and redo after Live, a slider, a bake with its cache and keyframes: the scene is whole, the view right."""
    if bpy.app.version < (4, 0):
        return  # without a window, older ones keep no undo steps
    push, back, again = bpy.ops.ed.undo_push, bpy.ops.ed.undo, bpy.ops.ed.redo

    def own():
        return bpy.data.objects["Hair"]

    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    strands.neuralocks_hair.model = MODEL
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    scene.frame_set(9)
    push(message="groomed")
    groomed = scenes.points(own())
    own().neuralocks_hair.live = True
    push(message="live")
    live = scenes.points(own())
    own().neuralocks_hair.motion = 0.2
    push(message="slider")
    slow = scenes.points(own())
    assert _apart(live, groomed) > 0.01 and _apart(slow, live) > 0.001

    back()
    assert own().neuralocks_hair.motion == 1.0 and _apart(scenes.points(own()), live) == 0.0
    back()
    assert not own().neuralocks_hair.live and "neuralocks_rest" not in own().data.attributes
    assert _apart(scenes.points(own()), groomed) == 0.0
    again()
    assert _apart(scenes.points(own()), live) == 0.0
    again()
    assert _apart(scenes.points(own()), slow) == 0.0
    again_at = bpy.context.scene
    again_at.frame_set(14)
    after = scenes.points(own())

    if getattr(bpy.app.build_options, "usd", True):
        push(message="before the bake")
        assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "cache.usdc")) == {"FINISHED"}
        push(message="attached")
        assert "Neuralocks Cache" in own().modifiers and not own().neuralocks_hair.live
        back()
        assert "Neuralocks Cache" not in own().modifiers and own().neuralocks_hair.live
        bpy.context.scene.frame_set(14)
        assert _apart(scenes.points(own()), after) == 0.0
    own().neuralocks_hair.live = False
    own_points = np.array([p.position for p in own().data.points])
    own().neuralocks_hair.live = True
    own().neuralocks_hair.live = False
    assert _apart(np.array([p.position for p in own().data.points]), own_points) == 0.0
    assert not _messages(), _messages()


def linked(folder: Path) -> None:
    """A linked character: clear words; an override plays its bake; local curves are live; nothing is lost."""
    if not hasattr(bpy.types.ID, "override_hierarchy_create") or bpy.app.version < (4, 0):
        return
    rig = scenes.armature()
    scenes.dance(rig)
    scenes.hair(rig, 20)
    scene = bpy.context.scene
    character = bpy.data.collections.new("Character")
    scene.collection.children.link(character)
    for thing in list(scene.collection.objects):
        character.objects.link(thing)
        scene.collection.objects.unlink(thing)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    scenes.empty()
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (_, wanted):
        wanted.collections = ["Character"]
    scene = bpy.context.scene
    scene.collection.children.link(bpy.data.collections["Character"])
    rig, strands = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    groomed = scenes.points(strands)
    _live(rig, strands)
    _at(strands, 9)
    message = next(text for name, text in _messages().items() if "Hair" in name)
    assert "linked" in message and "Make Local" in message, _messages()
    strands.neuralocks_hair.live = False
    for refused in (bpy.ops.neuralocks.bake_attach, bpy.ops.neuralocks.assign):
        try:
            refused()
        except RuntimeError as error:
            assert "linked from library.blend" in str(error), error
        else:
            raise AssertionError("what is done to linked data is not saved")
    assert not strands.modifiers
    assert _apart(_at(strands, 1), groomed) < 1e-6

    bpy.data.collections["Character"].override_hierarchy_create(scene, bpy.context.view_layer, do_fully_editable=True)
    rig, strands = (
        next(o for o in bpy.data.objects if o.type == kind and not o.library) for kind in ("ARMATURE", "CURVES")
    )
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    strands.neuralocks_hair.armature, strands.neuralocks_hair.model = rig, MODEL
    assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "cache.usdc")) == {"FINISHED"}
    played = _at(strands, 9)
    assert _apart(played, scenes.points(bpy.data.objects["Hair", str(bpy.data.libraries[0].filepath)])) > 0.01
    assert bpy.ops.neuralocks.detach() == {"FINISHED"}
    strands.make_local()
    strands.data.make_local()
    _live(rig, strands)
    assert _apart(_at(strands, 9), played) < SAME
    assert not _messages(), _messages()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    strands = next(o for o in bpy.data.objects if o.type == "CURVES" and not o.library)
    assert strands.neuralocks_hair.live and "neuralocks_rest" not in strands.data.attributes


def words(_folder: Path) -> None:
    """Every operator is found by Blender's search, and everything has a name and a tooltip."""
    import dcc_addon
    from dcc_addon import operators, properties

    assert dcc_addon.bl_info["name"] == "Neuralocks"
    for cls in operators.CLASSES:
        operator = getattr(bpy.ops.neuralocks, cls.bl_idname.split(".")[1])
        described = operator.get_rna_type()
        assert described.name == cls.bl_label and "INTERNAL" not in getattr(cls, "bl_options", ())
        assert described.description and not described.description.endswith("."), cls.bl_idname
        assert operator.poll(), "search hides what cannot run, and then nobody hears why"
        for prop in described.properties:
            assert prop.identifier == "rna_type" or prop.description, (cls.bl_idname, prop.identifier)
    for cls in properties.CLASSES:
        for prop in cls.bl_rna.properties:
            if prop.identifier in cls.__annotations__:
                assert prop.name and prop.description and not prop.description.endswith("."), prop.identifier
                if prop.type == "ENUM":
                    assert all(item.description for item in prop.enum_items), prop.identifier
