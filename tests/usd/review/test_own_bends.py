# SPDX-License-Identifier: Apache-2.0
"""What strands of few vertices store when they are bent, against circles."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from neuralocks_core.evaluation.pose_energies import energies
from neuralocks_core.groom import Groom
from neuralocks_core.materials import Material
from neuralocks_core.strands.arclength import arc_lengths
from usd.review.evaluate import evaluate
from usd.review.own_bends import OwnBends

from ..shots import Recipe, write_shot

RADIUS, LENGTH = 0.15, 0.2
WANTED = 0.5 * Material().bend / RADIUS**2
"""Energy of a straight rod bent to a circle [J/kg]; a polyline of n vertices bends at n - 2 of them, each for 1 / (n - 1) of the
rod."""


def straight(counts):
    return np.concatenate([np.linspace(0, LENGTH, n)[:, None] * [0, 1, 0] for n in counts])


def circle(counts):
    angle = np.concatenate([np.linspace(0, LENGTH / RADIUS, n) for n in counts])
    return RADIUS * np.stack([1 - np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def bent(rest, moved, counts):
    groom = Groom("hair", rest.astype(np.float32), np.array(counts, np.int32))
    bends = OwnBends(groom, np.arange(len(counts)), arc_lengths(groom)[0], rest, 1)
    bends.read(0, moved - rest)
    return bends


@pytest.mark.parametrize("counts", [(4,), (8, 8), (12,), (4, 8, 12, 12)])
def test_coarse_strands_store_what_a_circle_does(counts):
    bends = bent(straight(counts), circle(counts), counts)
    share = np.mean([(n - 2) / (n - 1) for n in counts])
    none = np.zeros((1, len(counts), 24, 3))
    assert bends.energy(none, none[0], Material()) == pytest.approx(share * WANTED, rel=0.03)


def test_doubled_vertices_bend_nothing():
    counts, rest, moved = (8,), straight((8,)), circle((8,))
    twice = [0, 0, 1, 2, 3, 4, 4, 5, 6, 7, 7]
    doubled = bent(rest[twice], moved[twice] + 1e-9 * np.arange(33).reshape(11, 3), (11,))
    none = np.zeros((1, 1, 24, 3))
    plain = bent(rest, moved, counts).energy(none, none[0], Material())
    assert doubled.energy(none, none[0], Material()) == pytest.approx(plain, rel=1e-4)


def test_strands_as_fine_as_the_networks_are_measured_as_ever():
    counts = (24, 24)
    bends = bent(straight(counts), circle(counts), counts)
    rest, moved = straight(counts).reshape(2, 24, 3), (circle(counts) - straight(counts)).reshape(1, 2, 24, 3)
    known = energies(rest + moved, rest, np.zeros((1, 3)))["bend"][0]
    assert bends.fine.all() and bends.energy(moved, rest, Material()) == pytest.approx(known, rel=1e-12)
    mixed = bent(straight((24, 8)), circle((24, 8)), (24, 8))
    alone = bent(straight((8,)), circle((8,)), (8,)).energy(moved[:, :1], rest[:1], Material())
    assert mixed.energy(moved, rest, Material()) == pytest.approx((known + alone) / 2, rel=1e-4)


def test_the_card_tells_the_bend_of_a_coarse_groom(tmp_path):
    """Straight hair of four vertices, keyed as circles in the head's frame, which stands still."""
    path = write_shot(tmp_path, Recipe(vertices=4, frames=1, bound="own"))
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    roots = np.array(points.Get()).reshape(-1, 4, 3)[:, :1]
    points.Set(Vt.Vec3fArray.FromNumpy((roots + straight((4,))).reshape(-1, 3).astype(np.float32)))
    stage.GetPrimAtPath("/Hero/Hair").GetRelationship("skel:skeleton").SetTargets([])
    for code in (1, 2):
        points.Set(Vt.Vec3fArray.FromNumpy((roots + circle((4,))).reshape(-1, 3).astype(np.float32)), code)
    stage.Save()
    values = evaluate(path, head="head").grooms["/Hero/Hair"]
    assert values["energy_bend"] == pytest.approx(2 / 3 * WANTED, rel=0.03)
