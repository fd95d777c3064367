# SPDX-License-Identifier: Apache-2.0
"""Strand inference with onnxruntime: what is the same for all frames once, what is the same for all strands
once a frame.

The first layer is linear in the strand and in the body, so its two parts are computed apart and added: exact, and a
third of the arithmetic is left per strand and frame. Strands go through in chunks that stay in a core's cache, several
cores each at one of its own.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cached_property, partial
from threading import Lock

import numpy as np

from neuralocks_core import model as model_file
from neuralocks_core.boundary import BoundarySampler, BoundarySpec
from neuralocks_core.character import Character
from neuralocks_core.clumping import COLUMN, Locks
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.locks import lock_codes
from neuralocks_core.motion import Clip
from neuralocks_core.strands import K, StrandSet, scalp_local

CHUNK = 512
"""Strands in one call: half a megabyte of hidden values, which stay in a core's second-level cache. Fixed,
so that results do not depend on the machine."""


class StrandModel:
    """A strand model ready to run.

    Args:
        file: a model read by `model.read`.
        threads: chunks of strands worked on at a time; the result does not depend on it.
    """

    def __init__(self, file: model_file.ModelFile, threads: int | None = None):
        self.file = file
        self.meta = file.meta
        self.spec = BoundarySpec.from_json(file.meta.get("boundary") or {})
        self.anchored = bool(file.meta.get("anchored", False))
        self.threads = threads or min(os.cpu_count() or 1, 8)
        self._pool = ThreadPoolExecutor(self.threads, thread_name_prefix="neuralocks")
        self._sessions = {name: graph_session(file, name) for name in model_file.KINDS["strands"]}
        read = [values.shape[-1] if values.shape else 1 for values in self._sessions["frame.onnx"].get_inputs()]
        if read != [self.spec.size]:
            raise NeuralocksError(
                f"{file.path}: its network reads {read[0] if len(read) == 1 else read} values, its description gives {self.spec.size}; "
                "get another copy"
            )

    @classmethod
    def load(cls, path: str | os.PathLike | None = None, threads: int | None = None) -> "StrandModel":
        """From a file; the shipped model where `path` is None."""
        return cls(model_file.read(path or model_file.shipped("strands"), "strands"), threads)

    def prepare(self, strands: StrandSet) -> "StrandSession":
        """Compute once what depends on the strands alone."""
        return StrandSession(self, strands)

    def sampler(self, character: Character, clip: Clip) -> BoundarySampler:
        """Boundary vectors as this model reads them."""
        return BoundarySampler(self.spec, character, clip)

    def run(self, graph: str, output: str, **inputs: np.ndarray) -> np.ndarray:
        """One output of one graph, float32."""
        return self._sessions[graph].run([output], inputs)[0]

    def frame(self, vector: np.ndarray) -> dict[str, np.ndarray]:
        """What all strands share in a frame, by the names under which the tail reads it, of a boundary vector
        (spec.size,)."""
        session = self._sessions["frame.onnx"]
        values = session.run(None, {"frame": np.asarray(vector, np.float32).reshape(1, -1)})
        return {output.name: value for output, value in zip(session.get_outputs(), values)}

    def by_chunk(self, function: Callable[[slice], None], count: int, start: int = 0) -> None:
        """Call `function` with the slice of every chunk of `count` strands, from the chunk that holds `start` on."""
        todo = chunks(count, start)
        left = iter(todo)

        def work() -> None:
            for chunk in left:
                function(chunk)

        # The caller works, too, and is not woken for each chunk: in Python threads that wake cost more than they do.
        others = [self._pool.submit(work) for _ in range(min(self.threads, len(todo)) - 1)]
        try:
            work()
        finally:
            wait(others)
        for other in others:
            other.result()

    def map(self, function: Callable, items) -> Iterable:
        """Results of calls on this model's threads, in order; a single one is made where it stands."""
        return map(function, items) if len(items) < 2 else self._pool.map(function, items)


class StrandSession:
    """A model bound to one groom.

    Attributes:
        strands: the groom.
        codes: latent codes z_rest, (S, 32).
    """

    def __init__(self, model: StrandModel, strands: StrandSet):
        self.model, self.strands = model, strands
        count = len(strands.rest)
        shape = np.ascontiguousarray(scalp_local(strands).reshape(count, -1))
        self.codes = self._by_chunk(lambda s: model.run("encoder.onnx", "code", shape=shape[s]), 32)
        inputs = strand_inputs(strands, self.codes)
        self._strand_part = self._by_chunk(lambda s: model.run("strand.onnx", "strand_part", strand=inputs[s]), 256)
        self._anchor = np.zeros((count, 3 * K), np.float32)
        self._anchored_at: np.ndarray | None = None
        self._turn = Lock()

    def anchor(self, vector: np.ndarray) -> None:
        """Measure an anchored model's answers from this boundary vector: the bind pose, held, with the
        materials in use.

        Costs one inference, and nothing when the vector is the one already in use.
        """
        vector, _ = self._without_clumping(vector)
        if not self.model.anchored or (self._anchored_at is not None and np.array_equal(vector, self._anchored_at)):
            return
        self._anchor[:] = 0
        self._anchor[:] = self._tail("offsets", self.model.frame(vector))
        self._anchored_at = vector

    def displacement(
        self, vector: np.ndarray, strands: slice = slice(None), out: np.ndarray | None = None
    ) -> np.ndarray:
        """Displacement (n, 24, 3) float32 [m] in canonical space for one boundary vector (spec.size,).

        Call `anchor` first where materials or body shape changed. Invalid strands stay at rest.
        """
        frame, gather = self._frame(vector)
        result = self._tail("displacement", frame, strands, out, gather)
        still = ~self.strands.valid[strands]
        if still.any():
            result[still] = 0
        return result.reshape(len(result), K, 3)

    def _frame(self, vector: np.ndarray):
        """What all strands share in a frame: the tail's inputs, and what to do to a chunk's displacement after it."""
        plain, clumping = self._without_clumping(vector)
        frame = self.model.frame(plain)
        if not clumping:  # exactly 0 for the default
            return frame, None
        locks, session = self._locks
        if self._anchored_at is not None:
            session.anchor(self._anchored_at)
        led = session._tail("displacement", frame).reshape(-1, K, 3)
        factor = locks.spread(vector[self.model.spec.slices["material"]])
        return frame, partial(locks.gather, led=led, factor=factor)

    def _without_clumping(self, vector: np.ndarray) -> tuple[np.ndarray, float]:
        """The vector for average clumping, and the logarithm of the clumping's ratio to that."""
        plain, column = np.array(vector, np.float32), self.model.spec.slices["material"].start + COLUMN
        clumping, plain[column] = float(plain[column]), 0.0
        return plain, clumping

    @cached_property
    def _locks(self) -> tuple[Locks, "StrandSession"]:
        locks = Locks.of(self.strands)
        return locks, self.model.prepare(locks.strands)

    def _tail(self, output, frame, strands: slice = slice(None), out=None, gather=None) -> np.ndarray:
        start, stop, _ = strands.indices(len(self.strands.rest))
        result = np.empty((stop - start, 3 * K), np.float32) if out is None else out.reshape(stop - start, 3 * K)

        # Chunks begin at fixed strands whatever slice is asked for, and are never cut short but at the groom's end: the
        # sums in a matrix product may depend on its height, and a bake must not depend on its split.
        def work(chunk: slice) -> None:
            values = self._chunk(output, chunk, frame)
            if gather is not None:
                gather(values, chunk)
            a, b = max(chunk.start, start), min(chunk.stop, stop)
            result[a - start : b - start] = values[a - chunk.start : b - chunk.start]

        self.model.by_chunk(work, min(-(-stop // CHUNK) * CHUNK, len(self.strands.rest)), start)
        return result

    def each(self, vector: np.ndarray, function: Callable[[slice, np.ndarray], None]) -> None:
        """Call `function(strands, displacement (n, 24, 3))` for every chunk of strands, in the thread that has just
        computed it and still has it in its cache, one at a time.
        """
        (frame, gather), valid = self._frame(vector), self.strands.valid

        def work(chunk: slice) -> None:
            values = self._chunk("displacement", chunk, frame)
            if gather is not None:
                gather(values, chunk)
            if not valid[chunk].all():
                values[~valid[chunk]] = 0
            # What is many small steps of Python goes slower in two threads than in one; beside a network it does not.
            with self._turn:
                function(chunk, values.reshape(-1, K, 3))

        self.model.by_chunk(work, len(self.strands.rest))

    def _chunk(self, output: str, chunk: slice, frame: dict[str, np.ndarray]) -> np.ndarray:
        """(n, 72) of one whole chunk."""
        return self.model.run(
            "tail.onnx",
            output,
            strand_part=self._strand_part[chunk],
            anchor=self._anchor[chunk],
            edges=_edges(self.strands.rest[chunk]),
            **frame,
        )

    def _by_chunk(self, function, width: int) -> np.ndarray:
        result = np.empty((len(self.strands.rest), width), np.float32)

        def work(chunk: slice) -> None:
            result[chunk] = function(chunk)

        self.model.by_chunk(work, len(result))
        return result


def chunks(count: int, start: int = 0) -> list[slice]:
    """The chunks of `count` strands, from the one that holds `start` on."""
    return [slice(low, min(low + CHUNK, count)) for low in range(start - start % CHUNK, count, CHUNK)]


def graph_session(file: model_file.ModelFile, name: str):
    """The onnxruntime session of one graph of a model.

    Raises:
        NeuralocksError: it is no graph that onnxruntime can load.
    """
    # Its official builds report sessions and the models' names to their maker, and keep an identifier in the home folder,
    # unless this is set before the first import; where that came too late, and on Windows, the call silences what follows.
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
    import onnxruntime

    onnxruntime.disable_telemetry_events()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # the cores share chunks instead: no waiting between layers
    options.enable_cpu_mem_arena = name == "tail.onnx"  # the others run once a groom or once a frame: they give it back
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(file.graphs[name], options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime raises its own bare types for whatever is wrong with a graph
        fact = str(error).splitlines()[0][:120]
        raise NeuralocksError(f"{file.path}: {name} cannot be loaded ({fact}); get an undamaged copy") from None


def _edges(rest: np.ndarray) -> np.ndarray:
    """(n, 72) rest edges, the first zero. Made anew for each chunk: that is cheaper than to keep them."""
    edges = np.zeros(rest.shape, np.float32)
    np.subtract(rest[:, 1:], rest[:, :-1], out=edges[:, 1:])
    return edges.reshape(len(rest), -1)


def strand_inputs(strands: StrandSet, codes: np.ndarray) -> np.ndarray:
    """What the network reads of each strand (S, 70) float32: root UV 2, z_rest 32, z_lock 32, root normal 3, length 1."""
    locks = lock_codes(codes, strands.lock, strands.valid)
    return np.concatenate([strands.uv, codes, locks, strands.root_normal, strands.length[:, None]], axis=1).astype(
        np.float32
    )
