# SPDX-License-Identifier: Apache-2.0
"""How deep the hair of several grooms is in the body that carries them: each frame's body is posed once for all of them."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from neuralocks_core import metrics
from neuralocks_core.body.collider import Collider
from neuralocks_core.body.enclosed import without_air
from neuralocks_core.character import Character
from neuralocks_core.deformation.resolve import Resolver, reach
from neuralocks_core.errors import about
from neuralocks_core.models.runtime import cores
from neuralocks_core.progress import Progress
from neuralocks_core.strands.strand_set import StrandSet

from .subject import Subject

FRAMES, DEEPEST_FRAMES = 32, 3
"""Frames in which distances to the body are measured: the former evenly over the bake, the latter where a groom's hair seems
deepest."""
LIMIT = 0.005
"""Up to this distance from the body [m], distances are exact."""


def depths(subjects: Sequence[Subject], say: Progress) -> list[dict]:
    """Shares of vertices inside the body, and the deepest, of each groom; empty where there is no body or no vertex to measure.

    Args:
        subjects: grooms of one head with samples at the same time codes.
        say: called with (done, total, message).
    """
    found: list[dict] = [{} for _ in subjects]
    alike: dict[float, list[int]] = {}  # the same part of the body is in their reach
    for number, each in enumerate(subjects):
        if each.own.shape[1]:
            alike.setdefault(reach(each.character, each.begun), []).append(number)
    for numbers in alike.values():
        for number, values in zip(numbers, _depths([subjects[number] for number in numbers], say), strict=True):
            found[number] = values
    return found


def _depths(subjects: list[Subject], say: Progress) -> list[dict]:
    """The same for grooms with the same part of the body in their reach, each with vertices to measure."""
    first = subjects[0]
    rig, baked = first.item.attachment.rig, first.baked
    resolver = Resolver(first.character, StrandSet.joined([each.begun for each in subjects]), rig.clip)
    with about(rig.path):
        if resolver.at_rest is None:
            return [{} for _ in subjects]
        resolver.prepare()
    joints, shapes = baked.joints(rig), baked.shapes(rig)
    bind = first.character.skeleton.bind, rig.clip.shape[0]
    at_rest = [_distance(first.character, resolver.at_rest, each.own_rest, *bind) for each in subjects]
    allowed = np.concatenate([np.minimum(distance, 0) for distance in at_rest])
    starts = np.cumsum([0, *(len(distance) for distance in at_rest[:-1])])

    def roughly(frame: int) -> np.ndarray:
        points = np.concatenate([each.own[frame] for each in subjects])
        distance = resolver.rough_distance(points, joints[frame], shapes[frame])
        return np.minimum.reduceat(distance - allowed, starts)

    def measured(frame: int) -> dict[int, np.ndarray]:
        body = resolver.collider(joints[frame], shapes[frame])
        pose = joints[frame], shapes[frame]
        return {
            number: _distance(first.character, body, subjects[number].own[frame], *pose) for number in wanted[frame]
        }

    with ThreadPoolExecutor(cores()) as pool:

        def told(function, frames) -> Iterator:
            for number, each in enumerate(pool.map(function, frames)):
                say(number + 1, len(frames), "measuring distances to the body")
                yield each

        even, frames = _frames(np.stack(list(told(roughly, range(len(joints))))))
        wanted = {
            frame: [number for number, own in enumerate(frames) if frame in own]
            for frame in dict.fromkeys(np.concatenate(frames).tolist())
        }
        found = dict(zip(wanted, told(measured, list(wanted)), strict=True))
    results = []
    for number, (own, rest) in enumerate(zip(frames, at_rest, strict=True)):
        distance = np.stack([found[frame][number] for frame in own.tolist()])
        worst = metrics.penetration(distance, rest)["penetration_worst_mm"]
        shares = metrics.penetration(distance[: len(even)], rest)
        results.append(shares | {"penetration_worst_mm": worst, "penetration_frames": len(even)})
    return results


def _frames(rough: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """The frames of a clip to measure: some evenly spread, and for each of G grooms these and then the ones in which it is deepest by
    rough distances (T, G) [m].
    """
    even = np.linspace(0, len(rough) - 1, min(len(rough), FRAMES)).round().astype(int)
    deepest = np.argsort(rough, axis=0, kind="stable")[:DEEPEST_FRAMES].T
    return even, [np.concatenate([even, np.setdiff1d(own, even)]) for own in deepest]


def _distance(
    character: Character, near: Collider, points: np.ndarray, joints: np.ndarray, shape: np.ndarray
) -> np.ndarray:
    """Signed distances (...) [m] of points (..., 3) to the body in a pose, of which `near` is what they can reach."""
    distance, _, nearest = near.closest(points, LIMIT)
    doubted = distance < -LIMIT * character.times_human
    doubted[doubted] = near.at_open_edge(points[doubted], nearest[doubted])
    if not doubted.any():
        return distance
    vertices = character.body.posed(character.skinning(joints), shape)
    return without_air(distance, points, doubted, vertices, character.body.triangles)
