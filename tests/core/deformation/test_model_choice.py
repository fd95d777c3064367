# SPDX-License-Identifier: Apache-2.0
"""Which of the shipped models moves a groom."""

from types import SimpleNamespace

import numpy as np
import pytest

from neuralocks_core.deformation import model_choice as module
from neuralocks_core.deformation.model_choice import suited
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.strands.resemblance import learned_hair
from neuralocks_core.strands.strand_set import strands_on

ORIGIN, CENTRE = np.array([0.0, 1.6, 0.0]), np.array([0.0, 0.1, 0.02])
CHARACTER = SimpleNamespace(
    canonical_to_bind=np.block([[np.eye(3), ORIGIN[:, None]], [0, 0, 0, 1]]), head_centre=CENTRE, facing=np.eye(3)
)


def _hair(length: float, seed: int = 0, aside: float = 0.0) -> Groom:
    """500 strands that hang from a skull."""
    direction = np.random.default_rng(seed).normal(size=(500, 3)) + [0, 1.5, 0]
    roots = ORIGIN + CENTRE + 0.1 * direction / np.linalg.norm(direction, axis=1, keepdims=True) + [aside, 0, 0]
    points = roots[:, None] + np.linspace(0, length, 12)[:, None] * [0, -1.0, 0]
    return Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(500, 12))


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    """As if models for hair of two lengths were shipped."""
    paths = []
    for name, length in (("long", 0.4), ("short", 0.05)):
        hair = learned_hair([strands_on(CHARACTER, _hair(length))])
        meta = {"kind": "strands", "training": {"hair": hair}}
        graphs = dict.fromkeys(model_file.KINDS["strands"], b"")
        paths.append(model_file.write(tmp_path / f"strands_{name}.neuralocks", meta, graphs))
    monkeypatch.setattr(model_file, "specialists", lambda: tuple(paths))
    module._specialists.cache_clear()
    yield dict(zip(("long", "short"), paths, strict=True))
    module._specialists.cache_clear()


def test_a_groom_gets_the_model_that_knows_such_hair(shipped):
    for name, length in (("long", 0.4), ("short", 0.05)):
        assert suited(None, CHARACTER, _hair(length, seed=1)) == shipped[name]


def test_other_hair_gets_the_model_that_knows_all(shipped):
    assert suited(None, CHARACTER, _hair(0.2)) == model_file.shipped()
    far = CHARACTER, _hair(0.05, seed=1, aside=0.3)
    assert suited(None, *far) == model_file.shipped()
    still = Groom("hair", np.zeros((4, 3), np.float32), np.array([2, 2]))
    assert suited(None, CHARACTER, still) == model_file.shipped()


def test_a_model_that_was_chosen_stays(shipped, tmp_path):
    for named in (tmp_path / "mine.neuralocks", model_file.shipped()):  # also the one for all hair
        assert suited(named, CHARACTER, _hair(0.4)) == named


def test_the_choice_does_not_depend_on_the_order_of_strands(shipped):
    groom = _hair(0.4, seed=2)
    assert suited(None, CHARACTER, groom.subset(np.arange(500)[::-1])) == shipped["long"]


def test_a_specialist_without_its_hair_is_named(shipped):
    file = model_file.read(shipped["long"])
    model_file.write(shipped["long"], {**file.meta, "training": {}}, file.graphs)
    with pytest.raises(NeuralocksError, match="strands_long.neuralocks: does not tell which hair it knows; install"):
        suited(None, CHARACTER, _hair(0.4))


def test_a_specialist_is_called_by_the_hair_that_it_knows(shipped):
    assert [model_file.kind_known(path) for path in (shipped["long"], model_file.shipped())] == ["long", ""]
    assert model_file.kind_known(model_file.Path("my_short.neuralocks")) == ""


def test_the_shipped_ones_can_stand_in_for_each_other():
    """Whichever of them moves a groom, cuts, wind and held poses mean the same."""
    first, *others = (StrandModel.load(path) for path in (model_file.shipped(), *model_file.specialists()))
    assert len(others) == 7 and first.feels_wind
    for other in others:
        assert other.spec == first.spec and other.feels_wind and other.anchored == first.anchored
        assert other.file.meta["credits"] and not other.file.shortcomings()
