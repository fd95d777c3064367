# SPDX-License-Identifier: Apache-2.0
"""The potentials against hand-computed values, each other, symmetry and float64 finite differences."""

import math

import numpy as np
import pytest
import torch

from neuralocks_core.materials import LINEAR
from neuralocks_core.physics import self_collision as volume
from neuralocks_core.physics.adhesion import adhesion
from neuralocks_core.physics.bend_twist import Cosserat, bend_twist
from neuralocks_core.physics.body_collision import body_collision
from neuralocks_core.physics.energies import Stiffness, Surroundings, energies
from neuralocks_core.physics.gravity import gravity
from neuralocks_core.physics.hair_style import hair_style
from neuralocks_core.physics.inertia import damping, inertia
from neuralocks_core.physics.rods import rods
from neuralocks_core.physics.stretch import stretch
from tests.core.physics.strands import moved, neighbours, rotation, straight

G = torch.tensor([0.0, -9.81, 0.0], dtype=torch.float64)


def _potentials(rest):
    """Every potential as a function of points, over the strands of `rest`."""
    r = rods(rest)
    planes = torch.tensor([0.0, 1.0, 0.0, -0.1], dtype=torch.float64).expand(*rest.shape[:-1], 4)
    dense = volume.density(rest, r.mass) * 0.9
    distance = torch.full(rest.shape[:-1], 0.01, dtype=torch.float64)
    forms = {f"bend {form.value}": lambda x, form=form: bend_twist(x, r, form=form) for form in Cosserat}
    return {
        "stretch": lambda x: stretch(x, r),
        "stretch of the paper": lambda x: stretch(x, r, 1e4, per_edge=True),
        **forms,
        "gravity": lambda x: gravity(x, r, G, 1.3),
        "inertia": lambda x: inertia(x, rest, rest + 0.001, r, 1 / 30),
        "damping": lambda x: damping(x, rest, r, 1 / 30, 10.0),
        "body": lambda x: body_collision(x, r, planes),
        "style": lambda x: hair_style(x, r, distance),
        "adhesion": lambda x: adhesion(x, r, neighbours()),
        "adhesion of the paper": lambda x: adhesion(x, r, neighbours(), paper=True),
        "volume": lambda x: volume.self_collision(x, r, dense),
        "volume of the paper": lambda x: volume.self_collision(x, r, dense, relative=False),
    }


NAMES = tuple(_potentials(torch.zeros(4, 12, 3, dtype=torch.float64) + torch.arange(12)[:, None]))


@pytest.mark.parametrize("name", [name for name in NAMES if name != "adhesion"])
def test_gradients_are_those_of_finite_differences(curls, name):
    start = moved(curls).requires_grad_()
    energy = _potentials(curls)[name]
    assert energy(start).abs().max() > 0, "an energy that is zero here tests nothing"
    assert torch.autograd.gradcheck(energy, (start,), eps=1e-7, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_a_batch_of_frames_is_each_frame_alone(curls, name):
    frames = torch.stack([moved(curls, seed) for seed in range(3)])
    energy = _potentials(curls)[name]
    torch.testing.assert_close(energy(frames), torch.stack([energy(frame) for frame in frames]))


def test_the_rest_shape_has_no_energy(curls):
    for name in ("stretch", "gravity", "style", "adhesion", *(f"bend {form.value}" for form in Cosserat)):
        assert _potentials(curls)[name](curls).abs().max() < 1e-20, name


def test_moving_without_deforming_costs_nothing(curls):
    away = curls + torch.tensor([0.3, -0.2, 0.5], dtype=torch.float64)
    turned = curls @ rotation().T
    for name in ("stretch", *(f"bend {form.value}" for form in Cosserat), "adhesion", "adhesion of the paper"):
        energy = _potentials(curls)[name]
        torch.testing.assert_close(energy(away), energy(curls), atol=1e-12, rtol=1e-9)
    # The whole space turned, rest shape and all, is the same strand.
    x = moved(curls)
    for name in ("stretch", "adhesion", "volume", *(f"bend {form.value}" for form in Cosserat)):
        here, there = _potentials(curls)[name](x), _potentials(turned)[name](x @ rotation().T)
        torch.testing.assert_close(there, here, atol=1e-12, rtol=1e-6)


def test_a_stretched_strand_by_hand():
    r = rods(straight(3, 0.2))
    x = straight(3, 0.22)
    assert stretch(x, r, 50.0).item() == pytest.approx(2 * 25.0 * 0.1 * 0.1**2)
    assert stretch(x, r, 50.0, per_edge=True).item() == pytest.approx(2 * 25.0 * 0.01**2)


def test_gravity_pulls_down_and_a_standing_strand_is_held():
    standing = straight(direction=(0.0, 1.0, 0.0))
    for supported in (False, True):
        x = standing.clone().requires_grad_()
        gravity(x, rods(standing, supported=supported), G).sum().backward()
        force = -x.grad[0]
        assert (force[1:].abs().max() < 1e-12) if supported else (force[1:, 1] < 0).all()
    assert gravity(standing - 0.1, rods(standing, supported=False), G).item() < 0


def test_hanging_hair_needs_no_support_and_the_bind_pose_is_an_equilibrium(curls):
    assert rods(straight()).support[:, 1:].abs().max() < 1e-15
    # With the support the net load on every vertex is what tension along its own edges balances: for a strand whose
    # edges may turn but not stretch, no direction change lowers the energy at rest.
    r = rods(curls)
    turn = torch.zeros(4, 11, 3, dtype=torch.float64, requires_grad=True)
    edges = curls.diff(dim=-2)
    turned = torch.nn.functional.normalize(edges / r.length[..., None] + turn, dim=-1)
    x = torch.cat([curls[:, :1], curls[:, :1] + torch.cumsum(turned * r.length[..., None], -2)], -2)
    gravity(x, r, G).sum().backward()
    assert turn.grad.abs().max() < 1e-12


def test_the_support_is_the_reference_solvers(curls):
    rest_rods = pytest.importorskip("neuralocks_core.reference.rest").rest_rods
    ours, theirs = rods(curls), rest_rods(curls.numpy())
    np.testing.assert_allclose(ours.support.numpy(), theirs.support, atol=1e-15)
    np.testing.assert_allclose(ours.mass.numpy(), theirs.mass, atol=1e-15)


def test_free_fall_has_no_inertia_force_against_gravity():
    """Minimising inertia + gravity over one step gives x_t = 2 x_{t-1} - x_{t-2} + dt^2 g."""
    dt, rest = 1 / 30, straight()
    r = rods(rest, supported=False)
    before2, before = rest, rest + dt * 0.2
    x = (2 * before - before2 + dt * dt * G).requires_grad_()
    (inertia(x, before, before2, r, dt) + gravity(x, r, G)).sum().backward()
    assert x.grad.abs().max() < 1e-12


def test_the_past_takes_gradient_only_when_asked():
    rest = straight()
    before = rest.clone().requires_grad_()
    assert not inertia(rest + 0.01, before, rest, rods(rest), 1 / 30).requires_grad
    inertia(rest + 0.01, before, rest, rods(rest), 1 / 30, detach=False).sum().backward()
    assert before.grad.abs().max() > 0


def test_damping_takes_half_of_the_rates_power_over_a_step():
    rest = straight()
    x = (rest + 0.003).requires_grad_()
    r = rods(rest)
    damping(x, rest, r, 0.1, 5.0).sum().backward()
    torch.testing.assert_close(x.grad, 5.0 * r.mass[..., None] * torch.full_like(rest, 0.03))


def test_the_body_pushes_outward_with_a_bounded_force_and_not_at_the_root():
    rest = straight(direction=(1.0, 0.0, 0.0))
    planes = torch.tensor([0.0, 1.0, 0.0, 0.0], dtype=torch.float64).expand(1, 24, 4)
    r = rods(rest)

    def force(height):
        x = (rest + torch.tensor([0.0, height, 0.0], dtype=torch.float64)).requires_grad_()
        body_collision(x, r, planes, 1e6, 0.004).sum().backward()
        return -x.grad[0, :, 1] / r.mass[0]

    assert not force(0.0041).any()
    assert not force(-0.01)[:2].any()
    assert force(0.001)[2].item() == pytest.approx(3e6 * 0.003**2)
    assert force(-0.3)[2].item() == pytest.approx(3e6 * LINEAR**2)


def test_the_style_fades_with_the_distance_to_the_body():
    rest = straight()
    x = rest + 0.01
    far = torch.linspace(0, 0.06, 24, dtype=torch.float64)[None]
    r = rods(rest)
    expected = (r.mass[0] * (1 - (far[0] / 0.03).clamp_max(1)) * 7.0 * 3e-4).sum()
    assert hair_style(x, r, far, 7.0).item() == pytest.approx(expected.item())
    at_skin = hair_style(x, r, torch.zeros_like(far), 7.0)
    assert hair_style(x, r, torch.full_like(far, -0.002), 7.0) == at_skin, "deeper is not held more"


def test_each_frame_of_a_batch_may_have_neighbours_of_its_own(curls):
    r, x = rods(curls), torch.stack([moved(curls, 1), moved(curls, 2)])
    both = torch.stack([neighbours(), neighbours().flip(-1)])
    expected = torch.stack([adhesion(x[i], r, both[i]) for i in range(2)])
    torch.testing.assert_close(adhesion(x, r, both), expected)


def test_adhesion_by_hand_and_its_force_that_of_one_spring():
    rest = torch.cat([straight(), straight() + torch.tensor([0.005, 0, 0])])
    r, k = rods(rest), 60.0
    pair = torch.arange(48).reshape(2, 24, 1).flip(0).to(torch.int32)
    pair = torch.cat([pair, pair, -torch.ones_like(pair)], -1)  # a mean, over those that are there
    x = rest.clone()
    x[1, :, 2] += 0.002
    assert adhesion(x, r, pair, k)[0].item() == pytest.approx(k * 0.24 * 0.002**2)
    assert adhesion(x, r, pair, k, paper=True)[0].item() == pytest.approx(k * 0.24 * (0.002**2 + 0.005**2))
    y = x.clone().requires_grad_()
    adhesion(y, r, pair, k).sum().backward()
    torch.testing.assert_close(y.grad[:, :, 2], 2 * k * r.mass * torch.tensor([[-0.002], [0.002]]))
    assert y.grad[..., :2].abs().max() < 1e-12


def test_crowded_hair_by_hand():
    """A quarter denser than at rest; less dense hair feels nothing."""
    r = rods(straight(3, 0.2))
    dense = volume.density(r.rest, r.mass)
    assert volume.self_collision(r.rest, r, 0.8 * dense, 2.0).item() == pytest.approx(2.0 * 0.2 * 0.25**3)
    papers = 2.0 * (r.mass * (0.2 * dense) ** 3).sum().item()
    assert volume.self_collision(r.rest, r, 0.8 * dense, 2.0, relative=False).item() == pytest.approx(papers)
    assert volume.self_collision(r.rest, r, 1.1 * dense, 2.0).item() == 0


def test_the_kernel_is_normalised_and_ends_smoothly_at_twice_h():
    radius = torch.linspace(0, 0.03, 20001, dtype=torch.float64)
    shells = 4 * math.pi * radius**2 * volume.kernel(radius, 0.015)
    assert torch.trapezoid(shells, radius).item() == pytest.approx(1.0, abs=1e-6)
    assert volume.kernel(torch.tensor([0.03, 0.5]), 0.015).abs().max() < 1e-6
    assert (volume.kernel(radius, 0.015).diff() <= 0).all()


def test_the_density_of_many_strands_is_that_of_all_pairs(curls, monkeypatch):
    """Pairs are found by nearness, block by block, with the gradient of each."""
    generator = torch.Generator().manual_seed(0)
    apart = 0.1 * torch.rand(2, 30, 1, 3, generator=generator, dtype=torch.float64)
    x = (curls[torch.arange(30) % 4] + apart).requires_grad_()
    mass = rods(x[0].detach()).mass
    weight = torch.rand(2, 30, 12, generator=generator, dtype=torch.float64)
    found = []
    for few, pairs in ((10**6, 1), (0, 10**6), (0, 5000)):
        monkeypatch.setattr(volume, "FEW", few)
        monkeypatch.setattr(volume, "PAIRS", pairs)
        density = volume.density(x, mass)
        found.append((density.detach(), *torch.autograd.grad((weight * density).sum(), x)))
    for density, gradient in found[1:]:
        torch.testing.assert_close(density, found[0][0], rtol=1e-12, atol=0.0)
        torch.testing.assert_close(gradient, found[0][1], rtol=1e-9, atol=1e-9)
    monkeypatch.setattr(volume, "PAIRS", 500)
    energy = _potentials(curls)["volume"]
    assert torch.autograd.gradcheck(energy, (moved(curls).requires_grad_(),), eps=1e-7, atol=1e-5, rtol=1e-4)


def test_the_density_of_a_whole_groom_fits_into_memory():
    """All pairs of 3,000 strands take 62 GB, those of 2,000 take 27."""
    roots = 0.2 * torch.rand(2000, 1, 3, generator=torch.Generator().manual_seed(0))
    groom = roots + straight(24, 0.3).float()
    assert volume.density(groom, rods(groom).mass).isfinite().all()


def test_the_sum_names_only_what_acts(curls):
    assert set(energies(curls, rods(curls), Surroundings())) == {"stretch", "bend_twist"}
    around = Surroundings(
        gravity=G,
        planes=torch.zeros(4, 12, 4, dtype=torch.float64),
        distance=torch.zeros(4, 12, dtype=torch.float64),
        neighbours=neighbours(),
        before=curls,
        before2=curls,
        moved_before=curls,
    )
    terms = energies(curls, rods(curls), around, Stiffness(style=10.0))
    assert len(terms) == 8 and all(term.shape == (4,) for term in terms.values())
    papers = energies(curls, rods(curls), around, paper_adhesion=True)["adhesion"]
    torch.testing.assert_close(papers, adhesion(curls, rods(curls), neighbours(), paper=True))
    assert not terms["adhesion"].any() and (papers > 0).all()
