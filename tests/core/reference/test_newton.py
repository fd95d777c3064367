# SPDX-License-Identifier: Apache-2.0
"""The reference beside newton's rods (capsules on elastic joints, solved by vertex block descent): three scenes.

Both get one kilogram per metre, so that joint stiffness is B / l. They share no code, unknowns (positions here, rigid bodies there)
or solver; the remaining difference is mostly numerical damping. Newton's kernels take a minute or two to compile, so these run only
when asked for: NEURALOCKS_COMPARE=1.
"""

import os
import warnings

import numpy as np
import pytest

if not os.environ.get("NEURALOCKS_COMPARE"):
    pytest.skip("newton's kernels take minutes to compile: set NEURALOCKS_COMPARE=1", allow_module_level=True)
pytest.importorskip("warp", reason="the reference needs warp")
newton = pytest.importorskip("newton", reason="the comparison needs newton: pip install 'neuralocks[compare]'")
import warp as wp

from neuralocks_core.reference import simulate
from neuralocks_core.warp_device import start_warp

EDGES, LENGTH, DT = 15, 0.3, 1 / 30
EDGE = LENGTH / EDGES


def straight(direction):
    return np.linspace(0, LENGTH, EDGES + 1)[:, None] * np.asarray(direction, float)


def newton_tips(rest, bend, shift, substeps=20, iterations=8, damping=0.0):
    """(T, 3) tips of newton's rod while its first segment follows `shift` (T, 3)."""
    start_warp("cpu")
    axis = (rest[-1] - rest[0]) / LENGTH
    builder = newton.ModelBuilder(gravity=(0.0, -9.81, 0.0))
    rod = newton.Rod.create_straight(
        start=wp.vec3(*rest[0]), direction=wp.vec3(*axis), length=LENGTH, segment_count=EDGES, radius=0.002
    )
    stiffness = bend / EDGE
    bodies, _ = builder.add_rod(
        rod=rod,
        stretch_stiffness=1e5,
        bend_stiffness=stiffness,
        bend_damping=damping,
        twist_stiffness=stiffness,
    )
    for body in bodies:
        mass, across, along = EDGE, EDGE**3 / 12, EDGE * 1e-6
        inertia = np.diag([across, across, along])
        if body == bodies[0]:
            mass, inertia = 0.0, np.zeros((3, 3))
        builder.body_mass[body], builder.body_inv_mass[body] = mass, 1 / mass if mass else 0.0
        builder.body_inertia[body] = wp.mat33(*inertia.ravel())
        inverse = np.linalg.inv(inertia) if mass else inertia
        builder.body_inv_inertia[body] = wp.mat33(*inverse.ravel())
    builder.color()
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverVBD(model, iterations=iterations)
    now, then, control = model.state(), model.state(), model.control()
    home = now.body_q.numpy()[bodies[0], :3].copy()
    tips = [rest[-1]]
    for t in range(1, len(shift)):
        for step in range(1, substeps + 1):
            pose = now.body_q.numpy()
            part = step / substeps
            pose[bodies[0], :3] = home + (1 - part) * shift[t - 1] + part * shift[t]
            now.body_q.assign(pose)
            now.clear_forces()
            solver.step(now, then, control, None, DT / substeps)
            now, then = then, now
        last = now.body_q.numpy()[bodies[-1]].astype(float)
        x, y, z, w = last[3:]
        tips.append(last[:3] + EDGE / 2 * np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]))
    return np.array(tips)


def our_tips(rest, bend, shift, substeps=20):
    head = np.tile(np.eye(4), (len(shift), 1, 1))
    head[:, :3, 3] = shift
    material = {"bend": bend, "damping": 0.0}
    result = simulate(
        rest[None],
        head,
        material=material,
        rest_support=False,
        substeps=substeps,
        start=rest[None],
        tolerance=1e-5,
    )
    return result.points[:, 0, -1].astype(float) + shift


def gap(ours, theirs):
    """Largest distance of the tips, relative to how far they went."""
    return np.linalg.norm(ours - theirs, axis=1).max() / np.linalg.norm(ours - ours[0], axis=1).max()


@pytest.fixture(autouse=True)
def _their_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def test_springy_rod_falls_and_comes_back():
    rest, shift = straight([0, 0, 1]), np.zeros((14, 3))
    assert gap(our_tips(rest, 2e-3, shift), newton_tips(rest, 2e-3, shift)) < 0.1


def test_limp_rod_falls_like_a_chain():
    rest, shift = straight([0, 0, 1]), np.zeros((10, 3))
    assert gap(our_tips(rest, 5e-4, shift), newton_tips(rest, 5e-4, shift)) < 0.07


def test_hanging_rod_follows_a_moving_root():
    rest, t = straight([0, -1, 0]), np.arange(20) / 30
    shift = 0.05 * (1 - np.cos(2 * np.pi * t))[:, None] * np.array([1.0, 0, 0])
    assert gap(our_tips(rest, 1e-3, shift), newton_tips(rest, 1e-3, shift)) < 0.07
