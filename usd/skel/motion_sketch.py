# SPDX-License-Identifier: Apache-2.0
"""What moves a skeleton, as a `sketch`: the same wherever a set places the character, and whatever its prims are called."""

from collections.abc import Iterator

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.sketch import sketch

from .joints import JointSource
from .rig_copy import source_of

AT_A_TIME = 64


def motion_sketch(source: JointSource, rate: float) -> str:
    """Bind pose, times of the samples [s], and at those times local joints, blend shape weights and the parents' motion.

    For a rig bake, those of the animation that it was made from: the bake moves the hair and not the body.
    """
    if source.animation and source_of(source.animation):
        source = JointSource(source.prim, unbaked=True)
    return sketch(_blocks(source, rate))


def _blocks(source: JointSource, rate: float) -> Iterator[np.ndarray]:
    codes, moves, names = source.keys.every, bool(source.placement.samples), source.shape_names
    yield source.bind
    yield np.array(codes) / rate
    back = np.linalg.inv(source.placement.reference)
    for first in range(0, len(codes), AT_A_TIME):
        some = codes[first : first + AT_A_TIME]
        yield source.local(some)
        yield from _weights(source, names, some)
        yield np.array([back @ source.placement.at(code) for code in some if moves])


def _weights(source: JointSource, names: tuple[str, ...], codes: list[float]) -> Iterator[np.ndarray]:
    """Blend shape weights; those that are broken are left out, and reported when they are read for a mesh."""
    try:
        yield source.shape(names, codes)
    except NeuralocksError:
        for name in names if len(names) > 1 else ():
            yield from _weights(source, (name,), codes)
