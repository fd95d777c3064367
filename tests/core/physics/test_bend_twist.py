# SPDX-License-Identifier: Apache-2.0
"""Bending and twisting: curvature, transported frames, and what each form gets wrong."""

import math

import pytest
import torch

from benchmarks.bend_twist import droop
from neuralocks_core.physics.bend_twist import Cosserat, bend_difference, bend_twist
from neuralocks_core.physics.rods import rods
from neuralocks_core.physics.transport import conjugate, direct_frames, loop_frames, product, scan_frames
from tests.core.physics.strands import moved, straight


def test_an_arch_bent_from_straight_has_the_energy_of_its_curvature():
    """k/2 integral of 1/R^2: per inner vertex 2 k / l (2 sin(l / 2R) / 2)^2, which tends to k l / 2 R^2."""
    radius, count = 0.1, 200
    angle = torch.linspace(0, 1.5, count, dtype=torch.float64)
    arch = radius * torch.stack([1 - torch.cos(angle), -torch.sin(angle), 0 * angle], -1)[None]
    chord = float((arch[0, 1] - arch[0, 0]).norm())
    first = (arch[0, 1] - arch[0, 0]) / chord
    straight = arch[:, :1] + torch.arange(count, dtype=torch.float64)[:, None] * chord * first
    for form in (Cosserat.EXACT, Cosserat.LOOP, Cosserat.DIRECT):
        energy = bend_twist(arch, rods(straight), 2.0, form)
        expected = 0.5 * 2.0 / radius**2 * radius * 1.5 * (count - 2) / (count - 1)
        assert energy.item() == pytest.approx(expected, rel=1e-4)


def test_a_right_angle_of_a_constant_director_by_hand():
    """Half of k |e - e0|^2 over the length between the edges."""
    rest = straight(3, 0.2)
    bent = rest + torch.tensor([[0.0, 0, 0], [0, 0, 0], [0.1, 0.1, 0]])
    assert bend_twist(bent, rods(rest), 3.0, Cosserat.CONSTANT).item() == pytest.approx(0.5 * 3.0 * 2 / 0.1)


def test_the_two_exact_transports_agree_and_are_orthogonal_to_the_tangent(curls):
    edges = torch.nn.functional.normalize(moved(curls).diff(dim=-2), dim=-1)
    torch.testing.assert_close(scan_frames(edges), loop_frames(edges), atol=1e-14, rtol=0)
    # A director that stands across the root edge is carried along as one that stands across each edge.
    director = torch.linalg.cross(edges[:, :1], torch.tensor([0.3, -0.5, 0.8], dtype=torch.float64).expand(4, 1, 3))
    carried = _turned(scan_frames(edges), director)
    assert (carried * edges).sum(-1).abs().max() < 1e-13 and carried.norm(dim=-1).min() > 0.1
    strain = bend_difference(moved(curls), curls, Cosserat.SCAN)
    torch.testing.assert_close(strain, bend_difference(moved(curls), curls, Cosserat.LOOP), atol=1e-13, rtol=0)


def test_transported_frames_turn_the_root_edge_into_each_edge(curls):
    edges = torch.nn.functional.normalize(curls.diff(dim=-2), dim=-1)
    for frames in (scan_frames(edges), direct_frames(edges)):
        torch.testing.assert_close(_turned(frames, edges[..., :1, :]), edges, atol=1e-12, rtol=0)


def test_straight_transport_invents_twist_in_a_curl_and_exact_does_not():
    """The strain's part along the edge, in the edge's own frame, is twist; a drawn curl has none."""
    t = torch.linspace(0, 1, 24, dtype=torch.float64)
    curl = torch.stack([0.03 * torch.cos(19 * t), -0.2 * t, 0.03 * torch.sin(19 * t)], -1)[None]
    uncurled = straight()
    root = torch.nn.functional.normalize(curl.diff(dim=-2), dim=-1)[:, :1]
    along = [
        (bend_difference(curl, uncurled, form) * root).sum(-1).abs().max().item()
        for form in (Cosserat.EXACT, Cosserat.DIRECT)
    ]
    assert along[0] < 1e-9 and along[1] > 0.05


@pytest.mark.parametrize("form", [Cosserat.LOOP, Cosserat.SCAN])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_what_lies_behind_a_fold_is_as_stiff_as_ever(form, dtype):
    """A fold is half a turn, about any axis: in its own frame the rest of the strand bends as if it were not there."""
    drawn = _bent_behind()
    folded = drawn.clone()
    folded[:, 12:] = 2 * drawn[:, 11:12] - drawn[:, 12:]
    there, without = (bend_twist(x.to(dtype), rods(straight().to(dtype)), form=form) for x in (folded, drawn))
    fold = bend_twist(_fold().to(dtype), rods(straight().to(dtype)), form=form)
    assert (there - fold).item() == pytest.approx(without.item(), rel=1e-3) and fold.item() > without.item()


@pytest.mark.parametrize("form", [Cosserat.LOOP, Cosserat.SCAN])
@pytest.mark.parametrize("doubled", [0, 1, 12])
def test_a_doubled_point_turns_nothing(form, doubled):
    """Neither in the energy nor in the gradient of the other points."""
    gradients, energies = [], []
    for double in (False, True):
        x = _bent_behind().requires_grad_()
        points = [x, straight()]
        if double:
            points = [torch.cat([p[:, : doubled + 1], p[:, doubled:]], dim=1) for p in points]
        strain = bend_difference(*points, form)
        energies.append(strain.square().sum())
        gradients.append(torch.autograd.grad(energies[-1], x)[0])
    torch.testing.assert_close(energies[1], energies[0])
    torch.testing.assert_close(gradients[1], gradients[0])


@pytest.mark.parametrize("form", [Cosserat.LOOP, Cosserat.SCAN])
def test_strands_with_doubled_points_bend_as_each_alone(form):
    x = torch.cat([torch.cat([p[:, : at + 1], p[:, at:]], dim=1) for at in (0, 5, 12) for p in [_bent_behind()]])
    together = bend_difference(x, straight(25).expand_as(x), form)
    torch.testing.assert_close(together, torch.cat([bend_difference(each[None], straight(25), form) for each in x]))


def test_folding_back_is_finite_in_value_and_gradient():
    back = torch.tensor([[0.0, 0, 0], [0, -1, 0], [0, -2, 0], [0, -1, 0], [0, 0, 0], [0, -1, 0]])[None] * 0.01
    for form in Cosserat:
        x = back.clone().requires_grad_()
        bend_twist(x, rods(straight(6, 0.05).float()), form=form).sum().backward()
        assert x.grad.isfinite().all()


def test_straight_transport_through_more_than_half_a_turn_in_a_plane_is_exact():
    """In a plane there is no twist to invent; past half a turn its quaternions come on the other side of the double cover."""
    count = torch.arange(24, dtype=torch.float64)
    x, rest = (
        0.01 / step * torch.stack([torch.cos(step * count), torch.sin(step * count), 0 * count], -1)[None]
        for step in (0.5, 0.4)
    )
    exact, direct = (bend_difference(x, rest, form).norm(dim=-1) for form in (Cosserat.EXACT, Cosserat.DIRECT))
    torch.testing.assert_close(direct, exact)
    torch.testing.assert_close(exact, torch.full_like(exact, math.sin(0.25) - math.sin(0.2)))


def _turned(frames, vectors):
    """Vectors (..., 3) turned by quaternions (..., 4) of unit length."""
    pure = torch.nn.functional.pad(vectors.expand(*frames.shape[:-1], 3), (1, 0))
    return product(product(frames, pure), conjugate(frames))[..., 1:]


def _bent_behind():
    """A strand straight down to its middle, and curled from there."""
    x, angle = straight(), 0.6 * torch.arange(11, dtype=torch.float64)
    x[:, 13:, 0] += 0.008 * (torch.cos(angle) - 1)
    x[:, 13:, 2] += 0.008 * torch.sin(angle)
    return x


def _fold():
    """A straight strand that goes back over itself from its middle on."""
    x = straight()
    x[:, 12:] = 2 * x[:, 11:12] - x[:, 12:]
    return x


def test_the_droop_that_the_docs_tell_is_an_equilibrium():
    """Which does not depend on the steps in which the weight grew."""
    for form, turns in ((Cosserat.DIRECT, 3), (Cosserat.CONSTANT, 3), (Cosserat.DIRECT, 0)):
        assert droop(form, turns, steps=2) == pytest.approx(droop(form, turns), abs=1e-5)
