# SPDX-License-Identifier: Apache-2.0
"""What the gauge says of answers whose errors are known."""

from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch")

from neuralocks_core.materials import NO_PLANE
from neuralocks_core.models.network_sizes import K
from neuralocks_core.training import gauge
from neuralocks_core.training.data.farm import Rollout
from neuralocks_core.training.learning.regression import predicted

HISTORY, FIRST, STEP = slice(2, 4), 5, 2.0**-12
LENGTH = np.array([0.2, 0.4, 0.3], np.float32)


def swung(seed, frames=40):
    """A rollout of two strands, the first of which swings farther; what it does before its first frame does not count."""
    rng, phase = np.random.default_rng(seed), np.arange(frames)[:, None, None, None] / 6
    way = rng.normal(size=(2, 1, 3)) * np.linspace(0, [300, 150], K, axis=1)[..., None]
    moved = np.round(way * np.sin(phase + seed)).astype(np.int16)
    moved[:FIRST] = 20_000
    planes = np.tile(np.array(NO_PLANE, np.float16), (frames, 2, K, 1))
    return Rollout(
        groom=0,
        strands=np.array([2, 0]),
        rest=np.zeros((2, K, 3), np.float32),
        first=FIRST,
        vectors=np.ones((frames, 5), np.float32),
        bind=np.zeros(5, np.float32),
        moved=moved,
        step=STEP,
        planes=planes,
        residual=0.0,
        materials=np.zeros((2, 4), np.float32),
    )


def measured(monkeypatch, rollouts, moving, held=0.25):
    """The gauge of a network that gives these shares of the true displacement, of a moving pose and of one that is held."""

    def predicted(net, bank, rollout, output, anchored):
        still = not rollout.vectors[:, HISTORY].any()
        assert rollout.vectors[:, [0, 1, 4]].all()
        return (held if still else moving) * rollout.moved.astype(np.float32) * rollout.step

    monkeypatch.setattr(gauge, "predicted", predicted)
    return gauge.measure(None, SimpleNamespace(rollouts=rollouts, lengths=[LENGTH]), "direction", HISTORY, True)


def test_an_answer_of_a_part_of_the_motion_is_wrong_by_the_rest(monkeypatch):
    rollouts = [swung(0), swung(1)]
    found = measured(monkeypatch, rollouts, 0.3)
    true = np.stack([r.moved[FIRST:] * STEP for r in rollouts])
    assert found.rigid == pytest.approx(100 * (np.linalg.norm(true, axis=-1) / LENGTH[[2, 0], None]).mean(), rel=1e-4)
    assert found.position == pytest.approx(0.7 * found.rigid) and found.static == pytest.approx(0.75 * found.rigid)
    expected = {
        "motion": 0.7,
        "motion_static": 0.75,
        "motion_ratio": 0.3,
        "droop": 0.3,
        "velocity": 0.7,
        "penetration": 0,
    }
    assert {name: getattr(found, name) for name in expected} == pytest.approx(expected, rel=1e-3)
    assert all(vector.all() for rollout in rollouts for vector in rollout.vectors), "the bank's own stay"


class Telling(torch.nn.Linear):
    """A network whose hair moves by the product of an entry of the frame's vector, the material's first number, and the strand's own."""

    def strand_part(self, strands):
        return strands

    def frame_part(self, frames):
        return frames

    def tail(self, strands, frames):
        return (frames[..., :1] * frames[..., 1:2] * strands).expand(-1, -1, 3 * K)


@pytest.mark.parametrize("anchored", [False, True])
def test_the_network_is_asked_for_each_strand_in_its_material_and_in_every_frame(anchored):
    rollout, rng = swung(0, frames=3), np.random.default_rng(0)
    rollout.materials[:, 0], rollout.bind[0] = [5.0, -7.0], 0.5
    rollout.vectors[:, 0] = rng.normal(size=3)
    own = rng.normal(size=(4, 1)).astype(np.float32)
    bank = SimpleNamespace(inputs=[own], material=slice(1, 5))
    found = predicted(Telling(1, 1), bank, rollout, "displacement", anchored)
    frame = rollout.vectors[:, 0] - (0.5 if anchored else 0.0)
    wanted = frame[:, None] * np.array([5.0, -7.0]) * own[rollout.strands, 0]
    assert not found[:, :, :2].any() and (rollout.vectors[:, 1:] == 1).all(), "the rollout's own stay"
    np.testing.assert_allclose(
        found[:, :, 2:], np.broadcast_to(wanted[..., None, None], found[:, :, 2:].shape), rtol=1e-5
    )


def test_hair_counts_as_inside_where_it_is_deeper_than_the_solvers_by_a_millimetre(monkeypatch):
    """A quarter of the frames has a plane: of vertices that go up by up to 69 mm, those that go half as far are too deep."""
    rollout = swung(0)
    rollout.moved[FIRST:] = 0
    rollout.moved[FIRST:, :, :, 1] = np.arange(K) * 0.003 / STEP
    rollout.planes[FIRST : FIRST + 9] = [0, 1, 0, 0.03]  # the solver's hair is inside up to vertex 10
    wrong = 0.0015 * np.arange(K) < np.minimum(0.003 * np.arange(K), 0.03) - 1e-3
    found = measured(monkeypatch, [rollout], 0.5)
    assert found.penetration == pytest.approx(100 * 9 / 35 * wrong.mean(), abs=1e-6)
