# SPDX-License-Identifier: Apache-2.0
"""In whose axes the header for engines reads and turns: those of an engine, of its joints, and of a rig bound askew."""

import re
from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.motion import Clip
from neuralocks_core.rig import RigSampler, find_chains
from neuralocks_core.rig.export_c import export_c
from neuralocks_core.rotation import from_quaternion, from_vector, to_quaternion
from tests.core.rig.builders import character, random_features, random_model, tail
from tests.core.rig.c_programs import INPUT_HARNESS, compiled, run_c

BIND_HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  int i;
  for (i = -1; i <= NL_HAIR_JOINTS; ++i) fwrite(nl_hair_joint_bind(i), sizeof(float), 4, stdout);
  return 0;
}
"""

UNITY, UNREAL = np.diag([-1.0, 1, 1]), np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]])
"""From an engine's axes to the header's."""


def into(axes, quaternions):
    """Rotations converted as the header's text says: (w, det(E) E v)."""
    return np.concatenate([quaternions[..., :1], np.linalg.det(axes) * quaternions[..., 1:] @ axes.T], axis=-1)


@pytest.mark.parametrize("engine", [np.eye(3), from_vector(np.array([0.3, 2, 1])), UNITY, UNREAL], ids=str)
def test_turns_in_other_joint_axes(tmp_path, engine):
    """An engine with any axes, whose importer gave joints other axes, gets what a bake writes for such a rig."""
    rows = tail("hair", 4)
    ours, theirs = (find_chains(character(rows, turn=from_vector(np.array(v)))) for v in ([0.3, -1, 0.6], [2.0, 1, 0]))
    model = replace(random_model((3,)), chains=ours)
    export_c(model, tmp_path / "hair.h")
    binds = run_c(compiled(tmp_path, BIND_HARNESS), [], 4)
    assert (binds[[0, -1]] == [1, 0, 0, 0]).all()  # for joints that are not there
    turns = model.evaluate(random_features(model, 20))
    wanted = from_quaternion(ours.turns_on(theirs, turns))
    assert np.abs(from_quaternion(turns) - wanted).max() > 0.1
    # A left-handed engine mirrors each joint's own axes, too: x here.
    mirror = UNITY if np.linalg.det(engine) < 0 else np.eye(3)
    for joint, bind in enumerate(from_quaternion(binds[1:-1])):
        own = engine.T @ theirs.axes[joint] @ mirror
        change = own.T @ engine.T @ bind
        there = from_quaternion(into(change, turns[:, joint]))
        np.testing.assert_allclose(there, mirror @ wanted[:, joint] @ mirror, atol=1e-6)
    text = (tmp_path / "hair.h").read_text()
    assert "turns become (w, x, -y, -z) and (w, -x, y, -z)" in text
    for engine, mirror, signs in ((UNITY, UNITY, [1, 1, -1, -1]), (UNREAL, np.diag([1, -1, 1]), [1, -1, 1, -1])):
        own = engine.T @ ours.axes[0] @ mirror  # as it was except for the mirror
        np.testing.assert_allclose(into(own.T @ engine.T @ ours.axes[0], turns[:, 0]), signs * turns[:, 0], atol=1e-6)


def test_rotations_of_other_axes(tmp_path):
    """The formula and the lines for two engines equal turning and mirroring everything."""
    export_c(random_model(), tmp_path / "hair.h")
    text = (tmp_path / "hair.h").read_text()
    q = np.random.default_rng(0).normal(size=(20, 4))
    for name, axes in (("Unity", UNITY), ("Unreal", UNREAL)):
        np.testing.assert_allclose(from_quaternion(into(axes, q)), axes @ from_quaternion(q) @ axes.T, atol=1e-9)
        place, turn = re.search(rf"{name}, .*position \(([^)]*)\).*\(w, ([^)]*)\)", text).groups()
        for words, matrix in ((place, axes), (turn, np.linalg.det(axes) * axes)):
            values = dict(zip("xyz", q[0, 1:]))
            said = [values[word[-1]] * (-1 if word[0] == "-" else 1) for word in words.split(", ")]
            np.testing.assert_allclose(said, matrix @ q[0, 1:], atol=1e-12)


def test_the_header_says_which_way_its_rig_faces(tmp_path):
    """Axes follow the upper arms: if a character is bound askew, an engine feeds what a bake reads once it turns by that angle."""
    rows = character(tail("hair", 4)).skeleton
    bind = rows.bind.copy()
    bind[rows.names.index("hips/chest/left_upper_arm"), 2, 3] += 0.1
    who = Character(Skeleton(rows.names, rows.parents, bind))
    trained = replace(random_model((3,)), chains=find_chains(who), training={"facing": round(who.facing_angle, 3)})
    export_c(trained, tmp_path / "hair.h")
    angle = float(re.search(r"turned by\s[ *]+(\S+) degrees about \+Y", (tmp_path / "hair.h").read_text())[1])
    assert 10 < angle < 20
    rng = np.random.default_rng(0)
    joints = np.tile(bind, (50, 1, 1, 1))
    read = [rows.names.index(f"hips/chest{name}") for name in ("/neck/head", "/neck", "")]
    joints[:, read, :3, :3] = from_vector(rng.normal(0, 0.5, (50, 3, 3)))
    t = np.zeros(1)
    sampler = [RigSampler(trained.spec, who, Clip(t, pose[None])).features(t)[0] for pose in joints]
    axes = from_vector(np.radians([0, angle, 0]))
    q = to_quaternion(axes @ joints[:, read, :3, :3] @ axes.T)
    rows = np.concatenate([q.reshape(50, 12), np.tile([0.0, -1.0, 0.0], (50, 1))], axis=1)
    assert np.abs(run_c(compiled(tmp_path, INPUT_HARNESS), rows, 15) - sampler).max() < 1e-3
    for facing, words in ((0.0, "it does)"), (None, "")):
        export_c(replace(trained, training={"facing": facing}), tmp_path / "hair.h")
        text = (tmp_path / "hair.h").read_text()
        assert "degrees about +Y" not in text and words in text
