# SPDX-License-Identifier: Apache-2.0
"""A strand model bound to one groom: what depends only on its strands is computed once and kept for all frames."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from neuralocks_core.deformation.clumping import Locks
from neuralocks_core.materials import RANGES, UNREAD
from neuralocks_core.models.network_sizes import HIDDEN, SHAPE, K
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.strands.locks import lock_codes
from neuralocks_core.strands.strand_set import StrandSet, scalp_local

CLUMPING = list(RANGES).index("clumping")


class StrandSession:
    """A model bound to one groom.

    Attributes:
        strands: the groom.
        strand_part: the first layer's part of each strand, (S, 256) float32.
        anchor_offsets: the outputs that an anchored model's are measured from, (S, 72) float32; see `anchor`.
    """

    def __init__(self, model: StrandModel, strands: StrandSet):
        self.model, self.strands = model, strands
        count = len(strands.rest)
        shape = np.ascontiguousarray(scalp_local(strands).reshape(count, -1))
        codes = self._by_chunk(lambda s: model.run("encoder.onnx", "code", shape=shape[s]), 32)
        inputs = np.ascontiguousarray(strand_inputs(strands, codes)[:, : model.strand_size])
        self.strand_part = self._by_chunk(lambda s: model.run("strand.onnx", "strand_part", strand=inputs[s]), HIDDEN)
        self.anchor_offsets = np.zeros((count, SHAPE), np.float32)
        self._anchored_at: np.ndarray | None = None

    def anchor(self, vector: np.ndarray) -> None:
        """Measure an anchored model's outputs from this boundary vector: the held bind pose with the materials in use.

        Costs one inference, or nothing if this vector is already in use.
        """
        vector = self._read(vector)
        if not self.model.anchored or (self._anchored_at is not None and np.array_equal(vector, self._anchored_at)):
            return
        self.anchor_offsets[:] = self._tail("offsets", self.model.frame(vector))
        self._anchored_at = vector

    def displacement(self, vector: np.ndarray) -> np.ndarray:
        """Displacement (S, 24, 3) float32 [m] in canonical space for one boundary vector (spec.size,).

        Call `anchor` first if materials or body shape changed. Invalid strands stay at rest.

        Raises:
            NeuralocksError: the vector has the wrong shape, or is not one of finite numbers.
        """
        result = np.empty((len(self.strands.rest), K, 3), np.float32)

        def put(chunk: slice, values: np.ndarray) -> None:
            result[chunk] = values

        self.each(vector, put)
        return result

    def _displaced(self, vector: np.ndarray) -> Callable[[slice], np.ndarray]:
        """What gives a chunk's displacement (n, 72) in a frame. What strands share is computed here, once."""
        vector = self.model.vector(vector)
        frame = self.model.frame(self._read(vector))
        material = vector[self.model.spec.slices["material"]]
        if not material[CLUMPING]:  # exactly 0 for the default
            return partial(self._chunk, "displacement", frame)
        return self._locks.gather(self._tail("displacement", frame), material)

    def _read(self, vector: np.ndarray) -> np.ndarray:
        """What the network is given of a vector."""
        read = self.model.vector(vector).copy()
        read[self.model.spec.slices["material"]][UNREAD] = 0
        return read

    @cached_property
    def _locks(self) -> Locks:
        return Locks.of(self.strands)

    def _tail(self, output: str, frame: dict[str, np.ndarray]) -> np.ndarray:
        """Output (S, 72) for all strands."""
        return self._by_chunk(partial(self._chunk, output, frame), SHAPE)

    def each(self, vector: np.ndarray, function: Callable[[slice, np.ndarray], None]) -> None:
        """Call `function(strands, displacement (n, 24, 3))` for every chunk of strands, in the thread that has just computed the chunk
        and still has it in its cache: several of them call it at a time.
        """
        displaced, valid = self._displaced(vector), self.strands.valid

        def work(chunk: slice) -> None:
            values = displaced(chunk)
            if not valid[chunk].all():
                values[~valid[chunk]] = 0
            function(chunk, values.reshape(-1, K, 3))

        self.model.by_chunk(work, len(self.strands.rest))

    def _chunk(self, output: str, frame: dict[str, np.ndarray], chunk: slice) -> np.ndarray:
        """Output (n, 72) for one whole chunk."""
        return self.model.run(
            "tail.onnx",
            output,
            strand_part=self.strand_part[chunk],
            anchor=self.anchor_offsets[chunk],
            edges=rest_edges(self.strands.rest[chunk]),
            **frame,
        )

    def _by_chunk(self, function, width: int) -> np.ndarray:
        result = np.empty((len(self.strands.rest), width), np.float32)

        def work(chunk: slice) -> None:
            result[chunk] = function(chunk)

        self.model.by_chunk(work, len(result))
        return result


def rest_edges(rest: np.ndarray) -> np.ndarray:
    """(n, 72) rest edges, the first zero. Computed again for each chunk, which is cheaper than keeping them."""
    flat, edges = rest.reshape(-1), np.empty(rest.size, np.float32)
    np.subtract(flat[3:], flat[:-3], out=edges[3:])  # one long row; the edge from strand to strand is the first
    edges = edges.reshape(len(rest), -1)
    edges[:, :3] = 0
    return edges


def strand_inputs(strands: StrandSet, codes: np.ndarray) -> np.ndarray:
    """What the network reads of each strand (S, 142) float32: root UV 2, z_rest 32, z_lock 32, root normal 3, length 1, as in
    the paper (section 3.3), and rest points from the root 72 [m, canonical space], since the code lacks the strand's direction.
    """
    locks = lock_codes(codes, strands.lock, strands.valid)
    points = (strands.rest - strands.rest[:, :1]).reshape(len(codes), -1)
    read = [strands.uv, codes, locks, strands.root_normal, strands.length[:, None], points]
    return np.concatenate(read, axis=1).astype(np.float32)
