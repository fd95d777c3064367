# SPDX-License-Identifier: Apache-2.0
"""What users get wrong gives one line that names the prim, file or argument, and leaves nothing behind."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import cannot_write
from usd.assets.groom import import_groom
from usd.baking.bake import bake
from usd.baking.join import join
from usd.baking.spool import Spool
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.shot.stage import read_shot

from .shots import JOINTS, Recipe, write_shot

HAIR, RIG, MOTION, SKIN = "/Hero/Hair", "/Hero/Rig", "/Hero/Rig/Motion", "/Hero/Skin"


def edited(folder, edit, recipe=Recipe()):  # noqa: B008
    """A shot with one thing broken."""
    path = write_shot(folder, recipe)
    stage = Usd.Stage.Open(str(path))
    edit(stage)
    stage.GetRootLayer().Save()
    return path


def attribute(path, name, value, time=None):
    """An edit that sets an attribute."""

    def edit(stage):
        target = stage.GetPrimAtPath(path).GetAttribute(name)
        target.Set(value) if time is None else target.Set(value, time)

    return edit


def changed(path, name, change, time=None):
    """An edit that changes the value that an attribute has."""

    def edit(stage):
        target = stage.GetPrimAtPath(path).GetAttribute(name)
        code = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
        value = target.Get(code)
        change(value) if not isinstance(value, float) else None
        target.Set(value, code)

    return edit


def scaled_root(*scale):
    def edit(stage):
        UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddScaleOp().Set(Gf.Vec3f(*scale))

    return edit


def unbound(stage):
    stage.GetPrimAtPath(RIG).GetRelationship("skel:animationSource").SetTargets([])


def renamed(stage):
    """No joint's name says head, and nothing binds the groom."""
    names = [f"bone{i}" for i in range(len(JOINTS))]
    paths = [names[0], *(f"{names[0]}/{n}" for n in names[1:])]
    stage.GetPrimAtPath(RIG).GetAttribute("joints").Set(paths)
    stage.GetPrimAtPath(MOTION).GetAttribute("joints").Set(paths)


def assign(index, value):
    def change(array):
        array[index] = value

    return change


def retyped(path, name, kind):
    """An edit that declares an attribute with another type, as whoever misreads a schema may."""

    def edit(stage):
        layer, target = stage.GetRootLayer(), Sdf.ValueTypeNames.Find(kind)
        spec = layer.GetAttributeAtPath(f"{path}.{name}")
        owner, variability = spec.owner, spec.variability
        owner.RemoveProperty(spec)
        value = [target.scalarType.defaultValue] * 8 if target.isArray else target.defaultValue
        Sdf.AttributeSpec(owner, name, target, variability).default = type(target.defaultValue)(value)

    return edit


NAN = float("nan")
BROKEN = {
    "nan points": (changed(HAIR, "points", assign(7, Gf.Vec3f(NAN, 0, 0))), HAIR, "not finite"),
    "all nan": (attribute(HAIR, "points", Vt.Vec3fArray(480, Gf.Vec3f(NAN))), HAIR, "not finite"),
    "infinite points": (changed(HAIR, "points", assign(8, Gf.Vec3f(float("inf"), 0, 0))), HAIR, "not finite"),
    "ragged counts": (changed(HAIR, "curveVertexCounts", assign(0, 11)), HAIR, "sum to"),
    "negative count": (changed(HAIR, "curveVertexCounts", assign(0, -12)), HAIR, "negative"),
    "no strands": (attribute(HAIR, "curveVertexCounts", []), HAIR, "no strands"),
    "no points": (attribute(HAIR, "points", []), HAIR, "no points"),
    "far points": (changed(HAIR, "points", assign(9, Gf.Vec3f(1e30, 0, 0))), HAIR, "check the unit"),
    "bad joint index": (attribute(HAIR, "primvars:skel:jointIndices", [99]), HAIR, "joint index"),
    "nan weight": (attribute(HAIR, "primvars:skel:jointWeights", [NAN]), HAIR, "weights"),
    "short skin": (attribute(SKIN, "primvars:skel:jointIndices", [0, 1]), SKIN, "joint indices"),
    "nan skin": (changed(SKIN, "points", assign(0, Gf.Vec3f(NAN))), SKIN, "NaN"),
    "bad face": (changed(SKIN, "faceVertexIndices", assign(0, 9999)), SKIN, "face"),
    "no animation": (unbound, RIG, "no animation"),
    "nan rotation": (changed(MOTION, "rotations", assign(3, Gf.Quatf(NAN)), 4), MOTION, "NaN"),
    "null rotation": (changed(MOTION, "rotations", assign(3, Gf.Quatf(0, 0, 0, 0)), 4), MOTION, "null rotation"),
    "short animation": (attribute(MOTION, "translations", [Gf.Vec3f(0)], 4), MOTION, "for 8 joints"),
    "few binds": (attribute(RIG, "bindTransforms", [Gf.Matrix4d(1)]), RIG, "for 8 joints"),
    "flat bind": (changed(RIG, "bindTransforms", assign(3, Gf.Matrix4d(0))), RIG, "zero scale"),
    "nan bind": (changed(RIG, "bindTransforms", assign(3, Gf.Matrix4d(NAN))), RIG, "NaN"),
    "no joints": (attribute(RIG, "joints", []), RIG, "no joints"),
    "double joint": (attribute(RIG, "joints", ["a"] * 8), RIG, "twice"),
    "joint animated twice": (attribute(MOTION, "joints", ["hips", *["a"] * 7]), MOTION, "'a' is listed twice"),
    "child first": (attribute(RIG, "joints", ["a/b", "a", *"cdefgh"]), RIG, "before its parent"),
    "offsets as joints": (retyped(RIG, "joints", "float3[]"), RIG, "its joints are float3[], not token[]"),
    "number as binds": (retyped(RIG, "bindTransforms", "float"), RIG, "are float, not matrix4d[]"),
    "offsets as binds": (retyped(RIG, "bindTransforms", "float3[]"), RIG, "are float3[], not matrix4d[]"),
    "words as faces": (retyped(SKIN, "faceVertexCounts", "token[]"), SKIN, "are token[], not int[]"),
    "words as corners": (retyped(SKIN, "faceVertexIndices", "token[]"), SKIN, "are token[], not int[]"),
    "number as skin": (retyped(SKIN, "points", "float"), SKIN, "are float, not point3f[]"),
    "words as indices": (retyped(SKIN, "primvars:skel:jointIndices", "token[]"), SKIN, "are token[], not int[]"),
    "number as weights": (retyped(SKIN, "primvars:skel:jointWeights", "double"), SKIN, "are double, not float[]"),
    "number as bind": (retyped(SKIN, "primvars:skel:geomBindTransform", "float"), SKIN, "are float, not matrix4d;"),
    "offsets as counts": (retyped(HAIR, "curveVertexCounts", "float3[]"), HAIR, "are float3[], not int[]"),
    "number as hair": (retyped(HAIR, "points", "float"), HAIR, "are float, not point3f[]"),
    "counts as hair": (retyped(HAIR, "points", "int[]"), HAIR, "are int[], not point3f[]"),
    "turns as hair": (retyped(HAIR, "points", "quath[]"), HAIR, "are quath[], not point3f[]"),
    "matrix as hair": (retyped(HAIR, "points", "matrix4d"), HAIR, "are matrix4d, not point3f[]"),
    "mirrored root": (scaled_root(-1, 1, 1), RIG, "mirrored"),
    "flat root": (scaled_root(1, 0, 1), "/Hero", "zero scale"),
    "nan root": (scaled_root(1, NAN, 1), "/Hero", "NaN"),
    "stray key": (attribute(MOTION, "translations", [Gf.Vec3f(0)] * 8, 1e9), RIG, "stray keys"),
    "no unit": (lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0), "shot.usda", "metersPerUnit"),
    "no rate": (lambda stage: stage.SetTimeCodesPerSecond(0), "shot.usda", "timeCodesPerSecond"),
    "no groom": (lambda stage: stage.RemovePrim(HAIR), "shot.usda", "no groom"),
    "no skeleton": (lambda stage: stage.RemovePrim(RIG), "shot.usda", "no UsdSkel skeleton"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_stage_is_named_in_one_line(tmp_path, model, case):
    edit, subject, fact = BROKEN[case]
    path = edited(tmp_path, edit)
    with pytest.raises(NeuralocksError) as caught:
        bake(path, tmp_path / "out.usdc", model)
    message = str(caught.value)
    assert subject in message and fact in message and "; " in message and "\n" not in message
    assert [p.name for p in tmp_path.iterdir()] == ["shot.usda"]
    try:
        facts = inspect(path)
    except NeuralocksError as error:
        assert fact in str(error)
    else:
        assert any(fact in line for line in facts["stops"])
        assert len(facts["stops"]) == len(set(facts["stops"])), "each is told once"


@pytest.mark.parametrize("name", ["hair.tfx", "hair.HAIR"])
def test_a_hair_file_in_place_of_a_stage_is_told_to_be_imported(tmp_path, model, name):
    (tmp_path / name).write_bytes(b"HAIR")
    with pytest.raises(NeuralocksError, match="is a hair file; make a USD groom of it with 'neuralocks import'"):
        bake(tmp_path / name, tmp_path / "out.usdc", model)


def test_a_stage_without_anything_lacks_skeleton_and_groom_whatever_it_is_called(tmp_path):
    Usd.Stage.CreateNew(str(tmp_path / "groom.usda")).Save()
    stops = inspect(tmp_path / "groom.usda")["stops"]
    assert "no UsdSkel skeleton; export the character" in stops[0] and "no BasisCurves prim" in stops[1]


def test_a_groom_alone_is_told_to_be_put_on_its_character(tmp_path, model):
    """As `neuralocks import` writes it; and where it misses a layer, that is the cause."""
    shot = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    stage.RemovePrim(RIG)
    stage.Save()
    for missing, remedy in (
        (None, "if it holds hair alone, sublayer or reference it"),
        ("lost.usda", "bring along what"),
    ):
        if missing:
            Sdf.Layer.FindOrOpen(str(shot)).subLayerPaths.append(missing)
        with pytest.raises(NeuralocksError, match=f"no UsdSkel skeleton; .*{remedy}") as caught:
            bake(shot, tmp_path / "out.usdc", model)
        assert str(caught.value).removeprefix(f"{tmp_path}/") in inspect(shot)["stops"]


def test_where_a_character_stands_that_cannot_be_used_stops_nothing_more(tmp_path):
    """Ten kilometres out by a transform, which a usable one bakes at."""
    shot = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp().Set((12000, 0, 0))
    stage.GetPrimAtPath("/Hero/Rig").GetAttribute("joints").Set(["rig:hips"])
    stage.Save()
    (stop,) = inspect(shot)["stops"]
    assert "'rig:hips', which is no path" in stop


def test_a_rig_without_a_head_can_be_helped_by_hand(tmp_path, model):
    path = edited(tmp_path, renamed, Recipe(bound="none"))
    with pytest.raises(NeuralocksError, match="--head"):
        bake(path, tmp_path / "out.usdc", model)
    assert bake(path, tmp_path / "out.usdc", model, head="bone3").grooms[0]["joint"].endswith("bone3")


WRONG = {
    "prim": ({"grooms": ["/Hero/Nope"]}, "/Hero/Nope: no such prim"),
    "no prim path": ({"grooms": ["Hair"]}, "Hair: no prim path"),
    "not a groom": ({"grooms": ["/Hero/Skin"]}, "without BasisCurves"),
    "skeleton": ({"skeleton": "/Nope"}, "/Nope: no such skeleton"),
    "head": ({"head": "nose"}, "nose"),
    "frames": ({"frames": "5:1"}, "5:1"),
    "no step": ({"frames": "1:5:0"}, "1:5:0: the range is empty"),
    "a step back": ({"frames": "1:5:-1"}, "1:5:-1: the range is empty"),
    "words as frames": ({"frames": "a:b"}, "a:b"),
    "endless frames": ({"frames": "0:1e12"}, "samples"),
    "more frames than numbers": ({"frames": "0:1e300:1e-300"}, "samples"),
    "jobs": ({"jobs": 0}, "--jobs 0"),
    "too many jobs": ({"jobs": 5000}, "1 to 1024"),
    "subframes": ({"subframes": 0}, "--subframes 0"),
    "material": ({"material": ["colour=3"]}, "colour"),
    "material range": ({"material": ["bend=1e9"]}, "bend"),
    "model": ({"model": "nope.neuralocks"}, "nope.neuralocks"),
    "folder as model": ({"model": "."}, "is a folder"),
    "number as model": ({"model": 5}, "model: 5 is no path"),
    "number as groom": ({"grooms": 5}, "grooms: 5 is no prim path"),
    "number as skeleton": ({"skeleton": 5}, "skeleton: 5 is no prim path"),
    "number as frames": ({"frames": 5}, "frames: 5 holds no time codes"),
    "word as cuts": ({"cuts": "25"}, "cuts: '25' holds no time codes"),
    "word as strength": ({"strength": "1"}, "--strength '1': must be a number from 0 to 4"),
    "no strength": ({"strength": float("nan")}, "--strength nan: must be"),
    "truth as jobs": ({"jobs": True}, "--jobs True: must be a whole number"),
    "list as joints": ({"joints": ["a"]}, "joints: .*'a'.* is no dict"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_argument_is_named(tmp_path, model, case):
    arguments, text = WRONG[case]
    recipe = Recipe(bound="none") if case == "head" else Recipe()
    with pytest.raises(NeuralocksError, match=text.replace("(", ".")):
        bake(write_shot(tmp_path, recipe), tmp_path / "out.usdc", **{"model": model, **arguments})
    assert [p.name for p in tmp_path.iterdir()] == ["shot.usda"]


@pytest.mark.parametrize("content", [b"", b"PXR-USDC" + bytes(80), b"#usda 1.0\ndef (", b"PK\x03\x04junk"])
@pytest.mark.parametrize("extension", ["usda", "usdc", "usdz"])
def test_no_usd_file_is_said_so(tmp_path, model, content, extension):
    path = tmp_path / f"bad.{extension}"
    path.write_bytes(content)
    with pytest.raises(NeuralocksError, match="bad"):
        bake(path, tmp_path / "out.usdc", model)


def test_truncated_crate_is_refused(tmp_path, model):
    path = write_shot(tmp_path, Recipe(extension="usdc"))
    data = path.read_bytes()
    path.unlink()
    for size in (10, 60, len(data) // 2, len(data) - 5):
        cut = tmp_path / f"cut{size}.usdc"
        cut.write_bytes(data[:size])
        with pytest.raises(NeuralocksError):
            bake(cut, tmp_path / "out.usdc", model)
        cut.unlink()
    assert not list(tmp_path.iterdir())


def test_values_that_cannot_be_unpacked_are_said_so(tmp_path, model):
    """Damage in the middle of a crate file: it opens, and its samples are gone."""
    path = write_shot(tmp_path, Recipe(extension="usdc", frames=40, vertices=24))
    whole = path.read_bytes()
    found = set()
    for place in range(200, len(whole) - 4000, len(whole) // 24):
        broken = tmp_path / f"{place}.usdc"
        broken.write_bytes(whole[:place] + b"\xff" * 64 + whole[place + 64 :])
        try:
            read_shot(broken)
        except NeuralocksError as error:
            assert str(error).startswith(str(broken)) or "/Hero" in str(error)
            found.add("damaged" in str(error))
            if "damaged" in str(error):
                with pytest.raises(NeuralocksError, match=f"{place}.usdc: .*damaged"):
                    read_shot(joints={}, path=broken)
    assert True in found


def test_bytes_that_are_no_text_are_said_so(tmp_path, model):
    """USD quotes them in its errors, and gives them for names that lie in a crate file."""
    text, crate = write_shot(tmp_path), tmp_path / "latin.usdc"
    Sdf.Layer.FindOrOpen(str(text)).Export(str(crate))
    latin, above = tmp_path / "latin.usda", tmp_path / "above.usda"
    latin.write_bytes(text.read_bytes().replace(b"#usda 1.0", b"#usda 1.0\n# caf\xe9", 1))
    crate.write_bytes(crate.read_bytes().replace(b"hips", b"h\xe9ps"))
    above.write_text(f"#usda 1.0\n(\n    subLayers = [@{latin.name}@, @{text.name}@]\n)\n")
    fact = r"holds bytes that are not UTF-8\)"
    for read in (read_shot, inspect, lambda path: join(path, tmp_path / "out.usdc")):
        with pytest.raises(NeuralocksError, match=rf"latin\.usda: .*{fact}; "):
            read(latin)
    with pytest.raises(NeuralocksError, match=rf"latin\.usdc: .*damaged \({fact}; export it again"):
        read_shot(crate)
    result = bake(above, tmp_path / "elsewhere" / "out.usdc", model, frames="1:2")
    assert any(note.startswith("above.usda: ") and "latin.usda" in note for note in result.notes)


def test_a_primvar_that_cannot_be_unpacked_is_said_of_the_file_that_is_imported(tmp_path):
    """It opens, and most of it are the numbers of one primvar."""
    path, rng = write_shot(tmp_path, Recipe(extension="usdc")), np.random.default_rng(0)
    stage = Usd.Stage.Open(str(path))
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(HAIR)).CreatePrimvar("groom_x", Sdf.ValueTypeNames.IntArray)
    primvar.Set(Vt.IntArray.FromNumpy(rng.integers(0, 3, 40_000, np.int32)))
    stage.Export(str(tmp_path / "groom.usdc"))
    whole = (tmp_path / "groom.usdc").read_bytes()
    place, broken = len(whole) // 2, tmp_path / "broken.usdc"
    broken.write_bytes(whole[:place] + b"\xff" * 9000 + whole[place + 9000 :])
    with pytest.raises(NeuralocksError, match=r"broken.usdc: .*damaged"):
        import_groom(broken, tmp_path / "out.usda")


@pytest.mark.parametrize("end", [float("inf"), float("nan"), -3.0])
def test_a_range_that_cannot_be_meant_gives_way_to_the_animations(tmp_path, end):
    shot = read_shot(edited(tmp_path, lambda stage: (stage.SetStartTimeCode(1), stage.SetEndTimeCode(end))))
    assert (shot.first, shot.last) == (1, 9)


def test_one_frame_is_a_held_pose(tmp_path, model):
    result = bake(write_shot(tmp_path, Recipe(frames=1)), tmp_path / "out.usdc", model)
    assert result.frames == [1.0] and any("one sample" in note for note in result.notes)
    layer = Sdf.Layer.FindOrOpen(str(result.path))
    assert not np.any(layer.QueryTimeSample(f"{HAIR}.velocities", 1.0))


def test_missing_blend_shapes_and_references_are_noted(tmp_path, model):
    def edit(stage):
        binding = UsdSkel.BindingAPI(stage.GetPrimAtPath(SKIN))
        binding.CreateBlendShapesAttr(["smile", "frown"])
        binding.CreateBlendShapeTargetsRel().SetTargets([f"{SKIN}/smile"])
        stage.GetPrimAtPath("/Hero").GetReferences().AddReference("./missing.usd")

    result = bake(edited(tmp_path, edit), tmp_path / "out.usdc", model)
    assert any("blend shape" in note for note in result.notes)
    assert any("missing.usd" in note for note in result.notes)


def test_a_body_that_is_inside_out_is_turned_round(tmp_path, model):
    def turned_round(stage):
        faces = UsdGeom.Mesh.Get(stage, SKIN).GetFaceVertexIndicesAttr()
        faces.Set(np.array(faces.Get()).reshape(-1, 4)[:, ::-1].ravel().tolist())

    right = bake(write_shot(tmp_path, name="as_made"), tmp_path / "right.usdc", model, frames=[5])
    wrong = bake(edited(tmp_path, turned_round), tmp_path / "wrong.usdc", model, frames=[5])
    assert not any("inside out" in note for note in right.notes) and any("inside out" in note for note in wrong.notes)
    points = [
        np.asarray(Sdf.Layer.FindOrOpen(str(r.path)).QueryTimeSample(f"{HAIR}.points", 5.0)) for r in (right, wrong)
    ]
    assert np.abs(points[0] - points[1]).max() < 2e-3


def test_strands_without_length_follow_the_head(tmp_path, model):
    def edit(stage):
        target = stage.GetPrimAtPath(HAIR).GetAttribute("points")
        points = np.array(target.Get())
        points[12:24] = points[12]
        target.Set(Vt.Vec3fArray.FromNumpy(points))

    result = bake(edited(tmp_path, edit), tmp_path / "out.usdc", model, frames=[5])
    assert any("1 of 40 strands" in note for note in result.notes)
    points = np.asarray(Sdf.Layer.FindOrOpen(str(result.path)).QueryTimeSample(f"{HAIR}.points", 5.0))
    assert np.isfinite(points).all() and np.ptp(points[12:24], axis=0).max() < 1e-6


def test_no_space_and_read_only_folders(tmp_path, model, monkeypatch):
    shot = write_shot(tmp_path)
    target = tmp_path / "file"
    target.write_text("")
    for out in (target / "out.usdc", target / "deeper" / "out.usdc"):  # a file where a folder should be
        with pytest.raises(NeuralocksError, match="a file, not a folder"):
            bake(shot, out, model)

    def full(self, *arguments):
        raise cannot_write(self.out, OSError(28, "No space left on device"))

    monkeypatch.setattr(Spool, "write", full)
    with pytest.raises(NeuralocksError, match="no space left"):
        bake(shot, tmp_path / "out.usdc", model)
    monkeypatch.setattr("usd.baking.samples.shutil.disk_usage", lambda folder: type("Usage", (), {"free": 1000}))
    with pytest.raises(NeuralocksError, match="needs"):
        bake(shot, tmp_path / "out.usdc", model)
    assert {p.name for p in tmp_path.iterdir()} == {"shot.usda", "file"}


@pytest.mark.parametrize(
    "made_of", ["(\n    subLayers = [@./groom.usda@]\n)", 'def "Hero" (\n    references = @./groom.usda@\n)\n{\n}']
)
def test_a_shot_that_came_without_its_layers_is_told_so(tmp_path, model, made_of):
    """Copied away from the layers that it is made of, a shot was said to need a groom."""
    path = tmp_path / "shot.usda"
    path.write_text(f"#usda 1.0\n{made_of}\n")
    for work in (lambda: bake(path, tmp_path / "a.usdc", model), lambda: bake_rig(path, tmp_path / "b.usda")):
        with pytest.raises(NeuralocksError, match=r"shot.usda: holds no .*groom.usda.*bring along") as caught:
            work()
        assert "\n" not in str(caught.value)
