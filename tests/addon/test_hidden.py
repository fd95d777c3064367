# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that a scale of zero hides, or a negative one mirrors, without Blender."""

import numpy as np
import pytest

from dcc_addon.services.rigs import rig
from dcc_addon.services.rigs.hidden import HIDDEN, check_placed, unhidden
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import from_vector

NAMES, PARENTS = ("root", "head", "hat", "feather"), np.array([-1, 0, 1, 2])
FRAMES = np.array([10.0, 11.0])
RIG = rig.RigArrays("Rig", NAMES, PARENTS, np.tile(np.eye(4), (4, 1, 1)))


def joints() -> np.ndarray:
    """Two frames (2, 4, 4, 4), in which all turn as one, twice as large."""
    found = np.tile(np.eye(4), (2, 4, 1, 1))
    found[..., :3, :3] = 2 * from_vector(np.array([0.3, -0.2, 0.5]))
    return found


def test_what_is_hidden_turns_as_its_parent_and_is_small():
    """Also below something hidden: it gets no smaller. Where nothing is hidden, nothing changes."""
    shown = joints()
    assert unhidden(shown, RIG, {0, 1}, FRAMES) is shown
    hidden = shown.copy()
    hidden[1, 2:, :3, :3] = 0
    found = unhidden(hidden, RIG, {0, 1}, FRAMES)
    np.testing.assert_array_equal(found[0], shown[0])
    np.testing.assert_array_equal(found[1, :2], shown[1, :2])
    np.testing.assert_allclose(found[1, 2:, :3, :3], HIDDEN / 2 * shown[1, 2:, :3, :3], rtol=1e-12)
    assert not hidden[1, 2:, :3, :3].any(), "the caller's array stays"


def test_what_is_mirrored_is_turned_back():
    mirrored = joints()
    mirrored[1, 3, :3, 0] *= -1
    np.testing.assert_allclose(unhidden(mirrored, RIG, {0, 1}, FRAMES), joints(), atol=1e-15)


@pytest.mark.parametrize(("joint", "needed"), [(1, {0, 1}), (0, {1})])
def test_what_hair_needs_may_not_be_hidden(joint, needed):
    """Nor may a root, from whose parent nothing could be taken."""
    hidden = joints()
    hidden[1, joint, :3, :3] = 0
    with pytest.raises(NeuralocksError, match=f"Rig: bone '{NAMES[joint]}' has zero scale in frame 11, .* above zero"):
        unhidden(hidden, RIG, needed, FRAMES)
    mirrored = joints()
    mirrored[0, 1, :3, 2] *= -1
    with pytest.raises(NeuralocksError, match="Rig: bone 'head' has a negative scale in frame 10, "):
        unhidden(mirrored, RIG, {0, 1}, FRAMES)


@pytest.mark.parametrize(
    ("factor", "words"), [(0.0, "has zero scale in frame 11"), (-1.0, "is mirrored .* in frame 11")]
)
def test_an_armature_that_is_hidden_or_mirrored_is_refused(factor, words):
    places = joints()[:, 0]
    check_placed(places, FRAMES, "Rig")
    places[1, :3, 0] *= factor
    with pytest.raises(NeuralocksError, match=f"Rig: it {words}, and its hair with it; "):
        check_placed(places, FRAMES, "Rig")
