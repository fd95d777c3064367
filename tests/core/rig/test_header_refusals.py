# SPDX-License-Identifier: Apache-2.0
"""Models of which no header is written."""

from dataclasses import replace

import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import export_c
from tests.core.rig.builders import random_model


def test_what_no_header_computes_is_refused(tmp_path):
    model = random_model((4,) * 2, 8, 0, rig_spec(True))
    for other in ({"linear": "velocity"}, {"pose_joints": ("neck", "left_shoulder")}):
        with pytest.raises(NeuralocksError, match="other inputs than a header computes"):
            export_c(replace(model, spec=replace(model.spec, **other)), tmp_path / "hair.h")
    with pytest.raises(NeuralocksError, match="has no layers"):
        replace(model, layers=())
    with pytest.raises(NeuralocksError, match="too large to compute with"):
        replace(model, layers=[(1e30 * weight, bias) for weight, bias in model.layers])


def test_limits_that_the_header_does_not_keep_are_refused(tmp_path):
    """It leaves the entries of rotations as they are, which are at most 1."""
    model = random_model()
    with pytest.raises(NeuralocksError, match=r"clamps entries of rotations to 0\.625, .*give it the limits of"):
        export_c(replace(model, limits=0.5 * model.limits), tmp_path / "hair.h")
    limits = model.limits.copy()
    limits[11] = 1.0  # the last one of the chest's: rounding may be beyond
    with pytest.raises(NeuralocksError, match="clamps entries of rotations to 1, "):
        export_c(replace(model, limits=limits), tmp_path / "hair.h")
    export_c(replace(model, limits=0.82 * model.limits), tmp_path / "hair.h")


@pytest.mark.parametrize("name", ["hair", "hair.c", "hair.H"])
def test_a_header_has_a_headers_name(tmp_path, name):
    with pytest.raises(NeuralocksError, match=r"a header ends in \.h or \.hpp"):
        export_c(random_model(), tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("prefix", ["", "my hair", "2nd", "_hair", "härchen", "a" * 42])
def test_a_prefix_that_no_name_in_c_begins_with_is_refused(tmp_path, prefix):
    """The longest one is fine: what is told is how to do it."""
    export_c(random_model(), tmp_path / "fine.h", "a" * 41)
    with pytest.raises(
        NeuralocksError, match=f"--prefix {prefix}: give a letter, then up to 40 letters without accents, digits"
    ):
        export_c(random_model(), tmp_path / "hair.h", prefix)
    assert not (tmp_path / "hair.h").exists()
