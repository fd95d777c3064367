# SPDX-License-Identifier: Apache-2.0
"""The loop under every training: its step sizes, its end, and going on."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from neuralocks_core.errors import NeuralocksError  # noqa: E402
from neuralocks_core.training.descent import Schedule, descend  # noqa: E402


def test_step_sizes():
    """Linear warm-up, halfway down at half of the budget, the floor at its end."""
    schedule = Schedule(rate=0.1, floor=0.02, warm_up=10)
    assert schedule.rate_at(0, 0.0) == pytest.approx(0.01)
    assert schedule.rate_at(4, 0.0) == pytest.approx(0.05)
    assert schedule.rate_at(100, 0.0) == pytest.approx(0.1)
    assert schedule.rate_at(100, 0.5) == pytest.approx(0.1 * 0.51)
    assert schedule.rate_at(100, 1.0) == schedule.rate_at(100, 1.3) == pytest.approx(0.002)


def test_it_finds_the_minimum_and_goes_on_where_it_was():
    """A quadratic; the last state is yielded, losses are named, a second run continues the count."""
    target = torch.tensor([1.0, -2.0])
    place = torch.nn.Parameter(torch.zeros(2))
    seen = []

    def losses(done):
        seen.append(done)
        return {"x": (place[0] - target[0]) ** 2, "y": (place[1] - target[1]) ** 2}

    schedule = Schedule(steps=300, rate=0.1, warm_up=1, smoothing=1)
    optimisers = [torch.optim.Adam([place])]
    *_, last = descend(optimisers, losses, schedule)
    assert (last.step, last.done) == (300, 1.0) and set(last.losses) == {"x", "y"}
    assert max(last.losses.values()) < 1e-3
    np.testing.assert_allclose(place.detach(), target, atol=0.02)
    np.testing.assert_allclose(seen, np.arange(300) / 300)
    seen.clear()
    *_, last = descend(optimisers, losses, schedule, step=250, done=250 / 300)
    assert last.step == 300 and len(seen) == 50 and seen[0] == pytest.approx(250 / 300)
    assert not list(descend(optimisers, losses, schedule, step=300, done=1.0))


def test_a_steep_step_is_clipped():
    """Plain gradient descent moves by rate times clip at most."""
    place = torch.nn.Parameter(torch.zeros(1))
    list(
        descend(
            [torch.optim.SGD([place])], lambda done: {"x": 1e6 * place.sum()}, Schedule(steps=1, rate=0.5, warm_up=1)
        )
    )
    assert float(place.detach()) == pytest.approx(-0.5)


def test_time_ends_it():
    """A budget in minutes is wall-clock time; at least one step is made."""
    place = torch.nn.Parameter(torch.ones(1))
    *_, last = descend([torch.optim.Adam([place])], lambda done: {"x": place.sum() ** 2}, Schedule(minutes=1e-6))
    assert last.step >= 1 and last.done == 1.0


@pytest.mark.parametrize("wrong", ["loss", "weight"])
def test_what_runs_away_is_told_before_anything_is_saved(wrong):
    place = torch.nn.Parameter(torch.ones(2))

    def losses(done):
        if wrong == "loss":
            return {"x": (place * 1e30).square().sum()}
        return {"x": (0 * place).sqrt().sum()}  # whose slope is beyond numbers

    schedule = Schedule(steps=3, rate=1000.0)
    with pytest.raises(NeuralocksError, match="not finite after 3 steps; train with a smaller --set rate than 1000$"):
        list(descend([torch.optim.Adam([place])], losses, schedule))
    with pytest.raises(NeuralocksError, match="; mind the rig$"):
        list(descend([torch.optim.Adam([place])], losses, schedule, remedy="mind the rig"))
