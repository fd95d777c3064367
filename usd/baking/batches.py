# SPDX-License-Identifier: Apache-2.0
"""Which grooms of a shot are posed together, so that hair in hundreds of prims costs little more than hair in one."""

from collections.abc import Callable, Hashable, Sequence

from ..shot.stage import StageGroom

TOGETHER = 1 << 14
"""Most strands in several grooms that are posed together, so that memory for per-strand data does not grow with the shot."""


def batches(grooms: Sequence[StageGroom], moved_by: Callable[[StageGroom], Hashable]) -> list[list[StageGroom]]:
    """Groups of grooms: those of one head go together if the same model moves them.

    The groups depend on the grooms alone, not on what is baked of them, so every part of a bake has the same groups.
    """
    return grouped(
        grooms, lambda item: (*_head(item), moved_by(item)), lambda item: item.groom.strand_count, most=TOGETHER
    )


def grouped(
    grooms: Sequence[StageGroom],
    key: Callable[[StageGroom], Hashable],
    strands: Callable[[StageGroom], int],
    most: int,
) -> list[list[StageGroom]]:
    """Groups of grooms with one key, wherever they stand in the stage, in the order of their first ones. Several have no more than
    so many strands in all.
    """
    found: list[list[StageGroom]] = []
    latest: dict[Hashable, tuple[list[StageGroom], int]] = {}
    for item in grooms:
        own, count = key(item), strands(item)
        group, held = latest.get(own, ([], most + 1))
        if held + count > most:
            group, held = [], 0
            found.append(group)
        group.append(item)
        latest[own] = group, held + count
    return found


def _head(item: StageGroom) -> tuple[str, int]:
    return item.attachment.rig.path, item.attachment.character.carrying_joint
