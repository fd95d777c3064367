# SPDX-License-Identifier: Apache-2.0
"""The baseline, and two solvers that share nothing but the energies against each other."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("warp", reason="the reference needs warp")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.hairstyles import Obstacle, Scalp, grow
from neuralocks_core.reference import simulate, simulate_xpbd
from neuralocks_core.strands.strand_set import strand_set
from tests.core.reference.swinging_heads import carried, edge_lengths, groom, shaken, sphere


def test_small_steps_and_newton_agree():
    """With more substeps, explicit XPBD and implicit Newton converge to one motion: same bend, support, damping, inertia."""
    rest, head = groom(20, curl=0), shaken(30)
    newton = simulate(rest, head, substeps=8, tolerance=1e-5).points
    moved = np.linalg.norm(newton - rest, axis=-1).mean()
    error = [
        np.linalg.norm(simulate_xpbd(rest, head, substeps=n).points - newton, axis=-1).mean() / moved for n in (15, 50)
    ]
    assert error[1] < 0.1 < error[0]


def test_curls_agree():
    """Curvature is carried along the same twist-free frame."""
    rest, head = groom(20, curl=0.6), shaken(30, 0.4)
    newton = simulate(rest, head, substeps=8, tolerance=1e-5).points
    moved = np.linalg.norm(newton - rest, axis=-1).mean()
    small = simulate_xpbd(rest, head, substeps=80).points
    assert np.linalg.norm(small - newton, axis=-1).mean() < 0.15 * moved


def library(style, strands=24):
    """(S, 24, 3) of a library's style on a ball's upper half, around its centre."""
    points, faces = sphere(0.09)
    upper = faces[points[faces, 1].min(1) > 0]
    scalp = Scalp(points, upper, np.zeros(3))
    groom = grow(style, scalp, strands, 3, Obstacle(scalp, (points, faces)))
    return strand_set(groom, np.zeros(3), np.zeros(3)).rest.astype(float)


@pytest.mark.parametrize("style", ["wavy", "tight_curls", "coils", "afro"])
def test_curls_come_to_rest(style):
    """The bending force has a potential: whatever turns the frame of a bend is pushed back by it."""
    rest = library(style)
    head = np.tile(np.eye(4), (75, 1, 1))
    head[:, 0, 3] = 0.03 * np.clip(np.arange(75) / 6, 0, 1)
    for bend in (1e-3, 1e-1):
        points = simulate_xpbd(rest, head, material={"bend": bend}).points[-15:]
        speed = 30 * np.linalg.norm(np.diff(points, axis=0), axis=-1).mean((0, 2))
        assert speed.max() < 3e-3


def test_curls_tend_to_the_implicit_solution():
    rest, head = library("tight_curls"), shaken(30)
    newton = simulate(rest, head, substeps=16, iterations=30, tolerance=1e-5).points
    moved = np.linalg.norm(newton - rest, axis=-1).mean()
    error = [
        np.linalg.norm(simulate_xpbd(rest, head, substeps=n).points - newton, axis=-1).mean() / moved
        for n in (20, 60, 180)
    ]
    assert error[2] < 0.03 and error[2] < 0.6 * error[1] < 0.36 * error[0]


def test_bind_pose_and_constant_speed():
    """The only change is the stretch that one pass per substep leaves."""
    rest = groom(8)
    head = np.tile(np.eye(4), (6, 1, 1))
    head[:, 0, 3] = np.arange(6) / 30
    points, faces = sphere(0.1005)
    result = simulate_xpbd(rest, head, carried(head, points), faces, bind_body=points, substeps=100)
    assert np.abs(result.points - rest).max() < 1e-3


@pytest.mark.parametrize("substeps", [20, 100])
def test_far_from_where_it_began(substeps):
    """A head that turns in a fast vehicle: a constant speed changes nothing, however far it has come."""
    rest, head = groom(8), shaken(60)
    head[:, :3, 3] = 0
    points, faces = sphere(0.1005)
    fast = head.copy()
    fast[:, 0, 3] = 150 * np.arange(60) / 30
    here, there = (
        simulate_xpbd(rest, way, carried(way, points), faces, bind_body=points, substeps=substeps).points
        for way in (head, fast)
    )
    assert np.linalg.norm(there - here, axis=-1).max() < 5e-4


def test_stretch_shrinks_with_substeps_and_nothing_breaks():
    rest, head = groom(8, curl=0.8), shaken(20, 1.5)
    stretch = []
    for substeps in (10, 40):
        points = simulate_xpbd(rest, head, substeps=substeps).points.astype(float)
        assert np.isfinite(points).all()
        stretch.append(np.abs(edge_lengths(points) / edge_lengths(rest) - 1).mean())
    assert stretch[1] < 0.3 * stretch[0]


def test_hair_that_starts_in_equilibrium_stays_there():
    """That of a tilted head, where hair at rest would fall."""
    rest, head = groom(8, curl=0.3), np.tile(np.eye(4), (20, 1, 1))
    head[:, :3, :3] = Rotation.from_euler("z", 70, degrees=True).as_matrix()
    held = simulate(rest, head[:1]).points[0]
    kept, fallen = (simulate_xpbd(rest, head, start=start, substeps=40).points for start in (held, None))
    assert np.abs(kept - held).max() < 0.05 * np.abs(fallen - rest).max() > 1e-3


@pytest.mark.parametrize("solver", [simulate, simulate_xpbd])
def test_motion_between_frames_does_not_depend_on_where_a_clip_is_cut_off(solver):
    """If it knows what comes after. The frames that only tell it are not simulated."""
    rest, head = groom(2), shaken(40)
    whole = solver(rest, head, substeps=5).points[:10]
    cut, told = (solver(rest, head[: 10 + ahead], substeps=5, ahead=ahead).points for ahead in (0, 24))
    assert told.tobytes() == whole.tobytes() != cut.tobytes()
    for ahead in (-1, 40, 1.5):
        with pytest.raises(NeuralocksError, match=f"ahead {ahead}: must be a whole number from 0 on"):
            solver(rest, head, ahead=ahead)


def test_no_substeps_is_refused():
    with pytest.raises(NeuralocksError, match="substeps"):
        simulate_xpbd(groom(2), np.eye(4)[None], substeps=0)
