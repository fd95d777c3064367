# SPDX-License-Identifier: Apache-2.0
"""Rollouts in memory, and what a step of the regression is given of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from neuralocks_core.deformation.strand_session import strand_inputs
from neuralocks_core.models.network_sizes import CODE

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("warp", reason="the extra 'train' is not installed")
from neuralocks_core.training.data.farm import save
from neuralocks_core.training.data.mirror import POLAR, mirrored_strands, mirrored_vectors
from neuralocks_core.training.data.rollouts import RolloutMaker, in_steps
from neuralocks_core.training.learning import methods, regression
from neuralocks_core.training.learning.methods import samples
from neuralocks_core.training.learning.regression import RolloutBank
from neuralocks_core.training.learning.regression_options import RegressionOptions


def test_hair_that_moves_by_metres_is_learned_as_it_moved(scene):
    rollout = RolloutMaker(scene).make(5)
    far = 40.0 * rollout.moved.astype(np.float32) * rollout.step
    assert np.abs(far).max() > 2.0
    moved, step = in_steps(far)
    bank = RolloutBank(scene, lambda strands: np.zeros((len(strands.rest), CODE), np.float32))
    bank.rollouts = [replace(rollout, moved=moved, step=step)]
    batch = bank.batch(np.random.default_rng(0), RegressionOptions(clips=60, moments=60, strands=64))
    assert batch["moved"].abs().max().item() == pytest.approx(np.abs(far).max(), rel=0.05)
    assert np.abs(moved * step - far).max() <= 0.51 * step
    assert step <= np.abs(far).max() / 16000


def test_a_step_sees_hairs_of_one_material_as_they_are_or_in_a_mirror(scene):
    """Their vectors tell that material; in a mirror, hair, motion and body change sides together."""
    hair, rollout = scene.grooms[0], RolloutMaker(scene).make(5)
    codes = hair.rest.reshape(len(hair.rest), -1)[:, :CODE]
    seen = codes + 1.0
    bank = RolloutBank(scene, lambda strands: codes if np.array_equal(strands.rest, hair.rest) else seen)
    bank.rollouts, spec = [rollout], scene.spec
    assert len(np.unique(rollout.materials, axis=0)) > 1
    for seed in range(8):
        options = RegressionOptions(clips=1, moments=5, strands=4)
        plain, other = (
            {name: values[0].numpy() for name, values in bank.batch(np.random.default_rng(seed), each).items()}
            for each in (options, replace(options, mirror=1.0))
        )
        rows = [next(i for i, rest in enumerate(rollout.rest) if np.array_equal(rest, own)) for own in plain["rest"]]
        material = plain["frames"][0, spec.slices["material"]]
        assert (rollout.materials[rows] == material).all()
        assert (plain["frames"][:, spec.slices["material"]] == material).all()
        late = [next(t for t, v in enumerate(rollout.vectors) if alike(v, own, spec)) for own in plain["frames"][:-1]]
        assert (np.diff(late)[::2] == 1).all() and min(late) >= rollout.first - 1
        np.testing.assert_allclose(plain["moved"], rollout.moved[late][:, rows] * rollout.step, atol=1e-7)
        np.testing.assert_array_equal(plain["planes"], rollout.planes[late][:, rows])
        np.testing.assert_array_equal(other["frames"], mirrored_vectors(spec, plain["frames"]))
        for name in ("rest", "moved"):
            np.testing.assert_array_equal(other[name], plain[name] * POLAR)
        np.testing.assert_array_equal(other["planes"], plain["planes"] * [*POLAR, 1])
        chosen = rollout.strands[rows]
        np.testing.assert_array_equal(plain["strands"], strand_inputs(hair, codes)[chosen])
        np.testing.assert_array_equal(other["strands"], strand_inputs(mirrored_strands(hair), seen)[chosen])
        np.testing.assert_array_equal(plain["length"], hair.length[chosen])
    options = RegressionOptions(clips=80, moments=1, strands=1, mirror=0.4)
    some = bank.batch(np.random.default_rng(0), options)["strands"].numpy()
    assert 18 <= sum((each != strand_inputs(hair, codes)).any(axis=1).all() for each in some) <= 46


def alike(vector, other, spec):
    """Whether two boundary vectors are those of one moment, whatever the material."""
    return all(np.array_equal(vector[part], other[part]) for part in (spec.slices["pose"], spec.slices["history"]))


def test_later_rollouts_replace_earlier_ones_and_a_resumed_training_has_the_same(scene, tmp_path, monkeypatch):
    """In memory and on disk: hours of simulations fit into neither. The first ones stay, for the inputs' scale comes from them."""
    monkeypatch.setattr(regression, "MOST", 5)
    monkeypatch.setattr(regression, "FIRST", 2)
    maker, files = RolloutMaker(scene), [tmp_path / f"{number:06d}.npz" for number in range(8)]
    for number, path in enumerate(files):
        save(path, maker.make(number))

    def bank():
        return RolloutBank(scene, lambda strands: np.zeros((len(strands.rest), CODE), np.float32))

    grown, again = bank(), bank()
    for some in (files[:3], files[:6], files):
        grown.add(some)
    again.add(files)
    assert grown.read == again.read == 8
    assert [path.stat().st_size > 0 for path in files] == [n in (0, 1, 5, 6, 7) for n in range(8)]
    for each in (grown, again):
        assert [rollout.moved.sum() for rollout in each.rollouts] == [
            maker.make(n).moved.sum() for n in (0, 1, 5, 6, 7)
        ]


def test_inputs_are_scaled_by_all_materials_and_strands_of_the_rollouts_and_by_some_of_every_groom():
    """Each strand has a material of its own, though the vectors hold the first one's; the rollouts stay as they are."""
    rng, material = np.random.default_rng(0), slice(1, 3)
    rollouts = [
        SimpleNamespace(groom=groom, strands=rng.integers(900, size=7), vectors=rng.normal(size=(9, 5)), materials=m)
        for groom, m in ((0, rng.normal(size=(7, 2))), (1, rng.normal(size=(7, 2))))
    ]
    before = [rollout.vectors.copy() for rollout in rollouts]
    inputs = [rng.normal(size=(count, 4)) for count in (1000, 999, 30)]
    strands, frames = samples(SimpleNamespace(inputs=inputs, rollouts=rollouts, material=material))
    own = [inputs[rollout.groom][rollout.strands] for rollout in rollouts]
    assert np.array_equal(strands, np.concatenate([*own, inputs[0][::2], inputs[1], inputs[2]]))
    for rollout, vectors, part in zip(rollouts, before, (frames[:9], frames[9:]), strict=True):
        assert np.array_equal(rollout.vectors, vectors)
        assert np.array_equal(np.delete(part, material, axis=1), np.delete(vectors, material, axis=1))
        assert np.array_equal(part[:, material], rollout.materials[[0, 1, 2, 3, 4, 5, 6, 0, 1]])


@pytest.mark.parametrize(("count", "first"), [(1000, regression.FIRST), (3, 3)])
def test_a_training_begins_with_the_first_simulations(monkeypatch, count, first):
    """Not hours later, with the last."""
    waited, bank = [], SimpleNamespace(inputs=[], read=0, add=lambda files: waited.append(files))
    monkeypatch.setattr(methods, "RolloutBank", lambda *_: bank)
    monkeypatch.setattr(methods, "wait", lambda farm, wanted, say, **_: say(1, wanted) or waited.append(wanted))
    farm, said = SimpleNamespace(count=count, files=lambda first=None: ["all", first]), []
    methods.RolloutMethod(None, None, RegressionOptions(minutes=1.0), farm, lambda *words: said.append(words))
    assert waited == [first, ["all", None]] and said == [(1 / first, f"first simulations: 1 of {first}", first)]
    methods.RolloutMethod(None, None, RegressionOptions(steps=9), farm, lambda *_: None)
    assert waited[2:] == [first, first, ["all", first]], "a run of so many steps reads no more, however many are there"
