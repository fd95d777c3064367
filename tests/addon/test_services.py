# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's services, without Blender: rigs, bodies, names, and what the panel says."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from pxr import Sdf

from dcc_addon.services.hair import bones
from dcc_addon.services.panel import card, panel_errors
from dcc_addon.services.panel.remaining import in_words
from dcc_addon.services.rigs import axes, names, rig
from dcc_addon.services.rigs.mirror import mirrored
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import Card
from neuralocks_core.models import model_file
from neuralocks_core.rig import rig_spec
from neuralocks_core.rotation import transformed
from tests.addon.few_bones import BONES, PARENTS, rest
from tests.rig_models import random_rig_model


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_mirrored_body_is_turned_right_side_out(side):
    """Two balls far apart, whose shape alone does not say which side is out."""
    ball = trimesh.creation.icosphere(2, 0.1)
    points = np.concatenate([ball.vertices, ball.vertices + [3.0, 0, 0]])
    body = rig.BodyArrays(
        "b", points, np.concatenate([ball.faces, ball.faces + len(ball.vertices)]), (), np.zeros((0, 3))
    )
    points, triangles, _ = rig.skin(body, np.diag([side, 1, 1, 1]))
    a, b, c = np.moveaxis(points[triangles].astype(float), 1, 0)
    assert np.einsum("fi,fi->", a, np.cross(b, c)) / 6 == pytest.approx(2 * ball.volume, rel=1e-5)


def test_blender_front_becomes_core_front():
    """Z up and looking along -Y becomes Y up and +Z; the unit is applied once."""
    core = axes.to_core(0.01)
    np.testing.assert_allclose(transformed([[0, -100, 0], [0, 0, 100], [100, 0, 0]], core),
                               [[0, 0, 1], [0, 1, 0], [1, 0, 0]], atol=1e-12)  # fmt: skip


def test_joint_paths_are_unique_and_accepted_by_usd():
    paths = names.joint_paths(["a.b", "a-b", "1c", "ä²", ""], [-1, 0, 0, 1, 1])
    assert paths == ["a_b", "a_b/a_b_2", "a_b/_1c", "a_b/a_b_2/ä_", "a_b/a_b_2/_"]
    assert all(Sdf.Path.IsValidPathString(path) for path in paths)
    assert names.unique(["Hair_ä"]) == ["Hair__"]  # a prim


def test_names_are_as_long_as_those_of_blenders_bones():
    """63 bytes, which Blender's own exporter keeps; the ends tell such names apart."""
    bones = [f"{'Hero_Rig_Hair_Back_Left_Strand_A_':x<61}{number:02d}" for number in (1, 2)] + ["髪" * 21]
    assert [path.split("/")[-1] for path in names.joint_paths(bones, [-1, 0, 1])] == bones
    long = names.unique(["x" * 90, "x" * 90, "髪" * 30, "髪" * 30], names.joint_identifier)
    assert len(set(long)) == 4 and max(len(name.encode()) for name in long) <= 63


def test_a_rig_with_japanese_names_is_read_by_them():
    """As MMD rigs arrive in Blender: the sides at the end, some digits full-width."""
    bones = ("センター", "上半身", "上半身２", "首", "頭", "髪１", "腕.L", "ひじ.L", "腕.R", "ひじ.R", "下半身")
    parents = np.array([-1, 0, 1, 2, 3, 4, 2, 6, 2, 8, 0])
    miku = rig.RigArrays("Miku", bones, parents, np.broadcast_to(np.eye(4), (11, 4, 4)))
    assert all(Sdf.Path.IsValidPathString(path) for path in miku.paths)
    found = {part: bones[joint] for part, joint in miku.humanoid.items()}
    wanted = {
        "head": "頭",
        "neck": "首",
        "upper_chest": "上半身２",
        "left_upper_arm": "腕.L",
        "right_lower_arm": "ひじ.R",
    }
    assert wanted.items() <= found.items(), found


def test_parents_come_first():
    order = names.parents_first([2, 0, -1, 1])
    assert list(order) == [2, 0, 1, 3]


def test_weights_keep_the_strongest_four():
    rows = [(0, g, w / 2) for g, w in enumerate((0.1, 0.4, 0.05, 0.3, 0.2))] + [
        (1, 5, 1.0)
    ]  # Blender takes sums as one
    body = rig.BodyArrays("b", np.zeros((3, 3)), np.zeros((0, 3), int), (*BONES[:5], "not a bone"), np.array(rows))
    indices, weights = rig.joint_weights(body, BONES)
    assert list(indices[0]) == [1, 3, 4, 0]
    np.testing.assert_allclose(weights[0], [0.4, 0.3, 0.2, 0.1])
    np.testing.assert_allclose(weights[1:], [[1, 0, 0, 0]] * 2)


def test_the_image_of_half_a_body_is_joined_along_the_seam():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]])
    half = rig.BodyArrays(
        "Half",
        points,
        np.array([[0, 1, 2], [1, 3, 2]]),
        ("arm.L", "arm.R"),
        np.array([[0, 0, 0.5], [1, 0, 1.0]]),
        {"wide": np.array([[0, 0, 0], [0.5, 0, 0.25], [0, 0, 0], [0, 0, 0.0]])},
    )
    whole = mirrored(half, np.diag([-1.0, 1, 1, 1]), np.array([1, 0]), 0.01)
    assert np.array_equal(whole.points[4:], [[-1, 0, 0], [-1, 0, 1]])
    assert np.array_equal(whole.triangles[2:], [[2, 4, 0], [2, 5, 4]])
    assert np.array_equal(whole.weights, [[0, 0, 0.5], [1, 0, 1], [4, 1, 1]])
    assert np.array_equal(whole.shapes["wide"][4:], [[-0.5, 0, 0.25], [0, 0, 0]])
    assert len(mirrored(half, np.diag([-1.0, 1, 1, 1]), np.array([1, 0])).points) == 8


def test_character_faces_forward_and_says_what_is_missing():
    found = rig.RigArrays("Rig", BONES, PARENTS, rest())
    character = rig.character(found, np.eye(4))
    np.testing.assert_allclose(character.facing, np.eye(3), atol=1e-9)
    assert character.skeleton.names[character.head].endswith("/head")
    assert rig.advice(found) == []
    lame = rig.RigArrays("Rig", BONES[:4], PARENTS[:4], rest()[:4])
    assert any("left arm" in line for line in rig.advice(lame))


def test_the_head_bone_that_is_chosen_is_the_head():
    found = rig.RigArrays("Rig", BONES, PARENTS, rest(), "neck")
    assert BONES[found.humanoid["head"]] == "neck"


def test_bodies_and_characters_are_the_same_only_in_all_their_numbers():
    """What is bound to a character, or was sampled with a body, is used again only then."""
    shapes = {"wide": np.full((3, 3), 0.5)}
    weights = np.array([[0, 0, 1.0], [1, 1, 1.0]])
    body = rig.BodyArrays("b", np.eye(3), np.array([[0, 1, 2]]), BONES[:2], weights, shapes)
    found = rig.RigArrays("Rig", BONES, PARENTS, rest())

    def character(body: rig.BodyArrays):
        return rig.character(found, np.eye(4), [(body, np.eye(4))])

    alike = replace(body, points=np.eye(3), shapes={"wide": np.full((3, 3), 0.5)})
    assert rig.same_arrays(body, alike) and rig.same(character(body), character(alike))
    for change in (
        {"points": 1.1 * np.eye(3)},
        {"triangles": np.array([[1, 0, 2]])},
        {"weights": np.array([[0, 1, 1.0], [1, 1, 1.0]])},
        {"shapes": {"wide": np.full((3, 3), 0.6)}},
        {"shapes": {"thin": np.full((3, 3), 0.5)}},
        {"groups": BONES[1:3]},
    ):
        other = replace(body, **change)
        assert not rig.same_arrays(body, other), change
        if "triangles" not in change:  # which is turned right side out
            assert not rig.same(character(body), character(other)), change
    assert not rig.same_arrays(body, replace(body, name="c"))
    taller = rig.RigArrays("Rig", BONES, PARENTS, 1.1 * rest())
    assert not rig.same(rig.character(found, np.eye(4)), rig.character(taller, np.eye(4)))


@pytest.mark.parametrize(
    ("bones", "head", "words"),
    [
        ((), "", "has no bones"),
        (("a", "b"), "", "no bone is named like a head"),
        (("a", "head"), "skull", "no bone 'skull'"),
    ],
)
def test_rig_problems_in_plain_words(bones, head, words):
    parents = np.arange(len(bones)) - 1
    with pytest.raises(NeuralocksError, match=words):
        rig.RigArrays("Rig", bones, parents, rest()[: len(bones)], head).humanoid


@pytest.mark.parametrize(
    ("points", "counts", "words"),
    [
        (np.zeros((0, 3)), [], "no strands"),
        (np.zeros((3, 3)), [1, 1, 1], "one point"),
        (np.full((2, 3), np.nan), [2], "finite"),
    ],
)
def test_bad_hair_in_plain_words(points, counts, words):
    with pytest.raises(NeuralocksError, match=words):
        rig.groom("Hair", points, np.array(counts, int), np.eye(4))


def test_errors_name_what_the_panel_has(tmp_path):
    """No option or command of a terminal, whatever the names of the chains."""
    skeleton = Skeleton(BONES, PARENTS, rest())
    arrays = rig.RigArrays("Rig", BONES, PARENTS, rest())
    character = Character(skeleton, None, arrays.humanoid)
    for patterns in ("", "curl*", "spine", "head"):
        with pytest.raises(NeuralocksError) as error:
            bones.chains_of(arrays, character, patterns)
        assert "--" in str(error.value) and "skeleton:" not in str(error.value)
        assert "--" not in (said := panel_errors.for_the_panel(str(error.value))) and "neuralocks " not in said, said
    with pytest.raises(NeuralocksError) as error:
        model_file.read(tmp_path / "nowhere.neuralocks", "strands")
    assert "--" not in panel_errors.for_the_panel(str(error.value))


def test_hair_bones_have_the_names_that_blender_shows():
    """In *Chains*, with wildcards or as a file has them, and in errors."""
    names, parents = ("spine", "head", "hair.01", "hair.02", "Pony Tail"), np.array([-1, 0, 1, 2, 1])
    places = np.tile(np.eye(4), (5, 1, 1))
    places[:, 1, 3] = [1.2, 1.6, 1.7, 1.8, 1.75]
    arrays = rig.RigArrays("Rig", names, parents, places)
    character = Character(Skeleton(arrays.paths, parents, places), None, arrays.humanoid)
    for wanted in ("hair.01", "hair.*", "hair_01", " hair.01 ,"):
        found = bones.chains_of(arrays, character, wanted)
        assert [arrays.bones[joint] for joint in found.joints] == ["hair.01"], wanted  # hair.02 is its free end
    with pytest.raises(NeuralocksError, match="^--chains hair.09, spine.1: no joint has such a name"):
        bones.chains_of(arrays, character, "hair.09, spine.1")
    with pytest.raises(NeuralocksError, match="'Pony Tail'"):
        bones.chains_of(arrays, character, "Pony Tail")
    bracketed = rig.RigArrays("Rig", ("spine", "head", "hair[LR]", "hair[LR].1", "hairL"), parents, places)
    assert bracketed.patterns("hair[LR], hair[A-Z]") == ["spine/head/hair_LR_", "spine/head/hairL"]


def test_a_bone_model_of_chains_of_another_length_is_refused_by_the_name_of_the_bone():
    """Its turns would be those of other hair."""
    names, parents = ("spine", "head", "hair.01", "hair.02", "hair.03"), np.arange(5) - 1
    places = np.tile(np.eye(4), (5, 1, 1))
    places[:, 1, 3] = [1.2, 1.6, 1.7, 1.6, 1.5]
    arrays = rig.RigArrays("Rig", names, parents, places)
    character = Character(Skeleton(arrays.paths, parents, places), None, arrays.humanoid)
    model = random_rig_model(bones.chains_of(arrays, character, "hair.01"), rig_spec())
    assert bones.LiveBones.of(model, arrays, character).bones == ("hair.01", "hair.02")
    places[3, 1, 3] = 1.65
    longer = Character(Skeleton(arrays.paths, parents, places), None, arrays.humanoid)
    with pytest.raises(NeuralocksError, match=r"'hair\.01' lies .* train a model for this rig"):
        bones.LiveBones.of(model, arrays, longer)


def test_card_fits_a_sidebar():
    lines = card.lines_of(
        Card("t", {"/Hair": {"droop_cm": 1.234, "settling_s": float("nan"), "strands": 7}}, notes=("n",))
    )
    assert lines == ["droop: 1.23 cm", "n"]


def test_card_of_the_panel_has_plain_numbers_that_an_artist_can_use():
    measured = {
        "stretch_cm": 5.39e-06,
        "energy_stretch": 5.01e-09,
        "stretch_percent_max": 1.2e-05,
        "penetration_percent": 0.05,
        "penetration_worst_mm": 1234.5,
        "droop_cm": -0.0001,
        "speed_cm_s": 31.42,
        "swing_percent": 12,
        "jitter_mm": 100.0,
    }
    assert card.lines_of(Card("t", {"/Hair": measured})) == [
        "length error, largest: 0 %",
        "vertices in the body: 0.05 %",
        "worst depth: 1234 mm",
        "droop: 0 cm",
        "speed relative to the head: 31.4 cm/s",
        "swing of the tips: 12 %",
        "jitter in a held pose: 100 mm",
    ]


def test_the_time_left_is_in_seconds_up_to_a_minute():
    said = [in_words(seconds) for seconds in (None, 0.0, 59.4, 59.6, 89.0, 3600.0)]
    assert said == ["", ", 1 s left", ", 59 s left", ", 1 min left", ", 1 min left", ", 60 min left"]
