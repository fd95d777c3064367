# SPDX-License-Identifier: Apache-2.0
"""What `neuralocks train` begins with, decided before anything large is read."""

import pytest

from neuralocks_core import model
from neuralocks_core.boundary import BoundarySpec
from neuralocks_core.errors import NeuralocksError

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")
from neuralocks_core.training.moment_options import SelfSupervisedOptions
from neuralocks_core.training.regression import RegressionOptions
from usd.train import _beginning

SPEC, OTHER = BoundarySpec(), BoundarySpec(bins=(1,) * 30)
LIKE, STILL, PAPER = RegressionOptions(), RegressionOptions(static=True), SelfSupervisedOptions.paper()


def test_left_out_it_is_the_shipped_model_where_that_fits():
    assert _beginning(None, False, SPEC, LIKE) == model.shipped()
    for spec, options in ((OTHER, LIKE), (SPEC, STILL), (SPEC, PAPER)):
        assert _beginning(None, False, spec, options) is None
    assert _beginning(None, True, SPEC, LIKE) is None, "a resumed training has its own beginning"


def test_what_is_named_is_taken_or_refused(tmp_path):
    assert _beginning("shipped", False, SPEC, LIKE) == model.shipped()
    assert _beginning("nothing", False, SPEC, LIKE) is None
    with pytest.raises(NeuralocksError, match="strands.neuralocks: differs from this training in static"):
        _beginning("shipped", False, SPEC, STILL)
    with pytest.raises(NeuralocksError, match="none.neuralocks: no such model file"):
        _beginning(tmp_path / "none.neuralocks", False, SPEC, LIKE)
