# SPDX-License-Identifier: Apache-2.0
"""Which grooms of a shot are posed together, so that hair in hundreds of prims costs little more than hair in one."""

from collections.abc import Callable, Hashable, Sequence

from ..shot.stage import StageGroom

TOGETHER = 1 << 14
"""Most strands in several grooms that are posed together, so that memory for per-strand data does not grow with the shot."""


def batches(grooms: Sequence[StageGroom], moved_by: Callable[[StageGroom], Hashable]) -> list[list[StageGroom]]:
    """Groups of grooms in their order: successive grooms of one head go together if the same model moves them.

    The groups depend on the grooms alone, not on what is baked of them, so every part of a bake has the same groups.
    """

    def key(item: StageGroom) -> tuple:
        return _head(item), moved_by(item)

    found: list[list[StageGroom]] = []
    strands = 0
    for item in grooms:
        strands += item.groom.strand_count
        if found and key(found[-1][0]) == key(item) and strands <= TOGETHER:
            found[-1].append(item)
        else:
            found.append([item])
            strands = item.groom.strand_count
    return found


def _head(item: StageGroom) -> tuple[str, int]:
    return item.attachment.rig.path, item.attachment.character.carrying_joint
