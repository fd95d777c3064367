# SPDX-License-Identifier: Apache-2.0
"""Attributes that a file declares otherwise than their schema does."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from usd.border.values import as_names, as_numbers
from usd.shot.stage import read_shot

from ..shots import write_shot


@pytest.fixture
def made():
    """Returns a function that makes an attribute of a type, with a value."""
    stage = Usd.Stage.CreateInMemory()

    def make(kind, value):
        stage.RemovePrim("/A")
        attribute = stage.DefinePrim("/A").CreateAttribute("b", Sdf.ValueTypeNames.Find(kind))
        attribute.Set(value)
        return attribute

    return make


@pytest.mark.parametrize(
    ("wanted", "kinds", "value"),
    [
        (
            "point3f[]",
            ("point3f[]", "float3[]", "double3[]", "half3[]", "vector3d[]", "int3[]"),
            [[1, 2, 3], [4, 5, 6]],
        ),
        ("int[]", ("int[]", "int64[]", "uint[]", "uchar[]", "float[]"), [3, 4, 5]),
        ("float[]", ("float[]", "double[]", "half[]", "int[]"), [0, 1, 2]),
        ("matrix4d[]", ("matrix4d[]", "frame4d[]"), [np.eye(4).tolist()]),
        ("matrix4d", ("matrix4d", "frame4d"), np.eye(4).tolist()),
    ],
)
def test_types_of_the_same_shape_are_read(made, wanted, kinds, value):
    for kind in kinds:
        spec = Sdf.ValueTypeNames.Find(kind)
        scalar = type(spec.scalarType.defaultValue)
        rows = [scalar(*each) if wanted == "point3f[]" else scalar(each) for each in value] if spec.isArray else value
        attribute = made(kind, type(spec.defaultValue)(rows))
        assert as_numbers(attribute, wanted, attribute.Get()).tolist() == value


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e30])
def test_what_is_no_whole_number_is_no_index(made, value):
    attribute = made("double[]", [0.0, value])
    with pytest.raises(NeuralocksError, match=r"/A: its b are double\[\], not int\[\]; export it again"):
        as_numbers(attribute, "int[]", attribute.Get(), np.int64)


def test_a_number_beyond_single_precision_is_infinite_there(made):
    attribute = made("double3[]", [(0, 1e300, 0)])
    assert as_numbers(attribute, "point3f[]", attribute.Get(), np.float32).tolist() == [[0, np.inf, 0]]


def test_a_signalling_nan_is_a_number_like_any_nan(made):
    attribute = made("float[]", Vt.FloatArray.FromNumpy(np.array([0x7FA00000], np.uint32).view(np.float32)))
    assert np.isnan(as_numbers(attribute, "float[]", attribute.Get())).all()


def test_no_value_and_an_empty_one_are_no_rows(made):
    assert as_numbers(made("point3f[]", []), "point3f[]", None).shape == (0, 3)
    empty = made("token[]", [])
    assert as_numbers(empty, "matrix4d[]", empty.Get()).shape == (0, 4, 4)
    assert as_names(made("int[]", []), None) == ()


def test_names_are_tokens_or_strings(made):
    for kind in ("token[]", "string[]"):
        attribute = made(kind, ["a", "b"])
        assert as_names(attribute, attribute.Get()) == ("a", "b")
    for kind, value in (("int[]", [1, 2]), ("token", "ab"), ("float", 1.0)):
        attribute = made(kind, value)
        with pytest.raises(NeuralocksError, match=rf"/A: its b are {kind[:3]}.*, not token\[\]; export it again"):
            as_names(attribute, attribute.Get())


def test_widths_of_another_type_are_left_as_they_are(tmp_path):
    path = write_shot(tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    hair = layer.GetPrimAtPath("/Hero/Hair")
    hair.RemoveProperty(hair.attributes["widths"])
    Sdf.AttributeSpec(hair, "widths", Sdf.ValueTypeNames.Float).default = 0.1
    layer.Save()
    shot = read_shot(path)
    assert (
        "/Hero/Hair: its widths are float, not float[]; export it again with that type; they are left as they are"
        in shot.notes
    )
    assert UsdGeom.BasisCurves(shot.grooms[0].prim).GetWidthsAttr().Get() == pytest.approx(0.1)
