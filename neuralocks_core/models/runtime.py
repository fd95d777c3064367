# SPDX-License-Identifier: Apache-2.0
"""Strand inference with onnxruntime: work that all frames share is done once, work that all strands share once per frame.

The first layer is linear in the strand and in the body, so its two parts are computed separately and added. This is exact,
and leaves a third of the arithmetic per strand and frame. Strands are processed in chunks that stay in a core's cache, one
chunk per core at a time.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import lru_cache

import numpy as np

from neuralocks_core.arguments import is_whole, number_array
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError, about, fact_of
from neuralocks_core.measures import another_body, known_body
from neuralocks_core.models import model_file
from neuralocks_core.models.graph_check import odd_part
from neuralocks_core.models.network_sizes import CODE, HIDDEN, PLAIN_STRAND, SHAPE, STRAND
from neuralocks_core.motion import Clip

CHUNK = 512
"""Strands in one call: half a megabyte of hidden values, which stay in a core's second-level cache. Fixed, so that results
do not depend on the machine."""
IN = {
    "encoder.onnx": {"shape": SHAPE},
    "tail.onnx": {"strand_part": HIDDEN, "anchor": SHAPE, "edges": SHAPE},
}
"""Inputs of the graphs, with their numbers per row. `strand.onnx` reads `StrandModel.strand_size` numbers of a strand, `frame.onnx`
the boundary vector, and the tail also reads all outputs of the frame graph."""
OUT = {
    "encoder.onnx": {"code": CODE},
    "strand.onnx": {"strand_part": HIDDEN},
    "frame.onnx": {"frame_part": HIDDEN},
    "tail.onnx": {"offsets": SHAPE, "displacement": SHAPE},
}
CHANGED = {"middle": HIDDEN, "out": SHAPE}
"""Further outputs of the frame graph if it changes the weights of the tail."""
ROWS = {"frame_part": 1, "middle": HIDDEN, "out": HIDDEN}
"""Rows of the frame graph's outputs; all other arrays have one a strand."""
GRAPHS = 24
"""Graphs that stay loaded: of six models. A model that is read again, as for another scene or groom, need not be loaded again."""
LARGEST = 1e7
"""Outputs with a larger root mean square cannot be hair, whatever its units."""


class StrandModel:
    """A strand model ready to run.

    Attributes:
        spec: of the boundary vectors that it reads.
        anchored: whether its outputs are measured relative to that for the bind pose.
        strand_size: how many numbers of `strand_session.strand_inputs` it reads, from the first.

    Args:
        file: a model read by `model_file.read`.
        threads: number of chunks of strands processed at a time, by default one a core; the result does not depend on it.

    Raises:
        NeuralocksError: its description or graphs are not those of a strand model, or `threads` is no such number.
    """

    def __init__(self, file: model_file.ModelFile, threads: int | None = None):
        self.file = file
        self.meta = file.meta
        with about(file.path):
            self.spec = BoundarySpec.from_json(file.meta.get("boundary"))
        self.anchored = file.meta.get("anchored", False)
        if not isinstance(self.anchored, bool):
            raise NeuralocksError(f"{file.path}: its 'anchored' is neither true nor false; get an undamaged copy")
        if threads is not None and not is_whole(threads, 1):
            raise NeuralocksError(f"threads {threads!r}: must be a whole number from 1 on; leave it out for one a core")
        self.threads = threads or cores()
        self._pool = ThreadPoolExecutor(self.threads, thread_name_prefix="neuralocks")
        self._sessions = {name: graph_session(file, name) for name in model_file.KINDS["strands"]}
        self._check_graphs()

    @classmethod
    def load(cls, path: str | os.PathLike | None = None, threads: int | None = None) -> "StrandModel":
        """Load a file, or the shipped model if `path` is None.

        Raises:
            NeuralocksError: it is missing, damaged, of a later format or not a model of strands.
        """
        return cls(model_file.read(model_file.shipped("strands") if path is None else path, "strands"), threads)

    @property
    def feels_wind(self) -> bool:
        """Whether wind moves its hair: it reads a history of effective gravity, which training has not left out."""
        return self.spec.feels_wind and self.meta.get("static") is not True

    def sampler(self, character: Character, clip: Clip) -> BoundarySampler:
        """Boundary vectors as this model reads them."""
        return BoundarySampler(self.spec, character, clip)

    def another_body(self, character: Character, clip: Clip) -> str:
        """The measure in which a body in a clip differs most from those that this model has learned; "" if it is like one of
        them, or if the card does not say.
        """
        return another_body(character, clip.shape[0], self.meta["training"].get("measures"))

    def knows(self, character: Character, clip: Clip) -> bool:
        """Whether the card tells that a body in a clip is like one that this model has learned."""
        return known_body(character, clip.shape[0], self.meta["training"].get("measures"))

    def run(self, graph: str, output: str, **inputs: np.ndarray) -> np.ndarray:
        """One output of one graph, float32, from arrays by the names of its inputs: graphs, names and shapes are those of
        docs/architecture.md, The model file.

        Raises:
            NeuralocksError: there is no such graph, output or input, an array is not of finite numbers or has other rows, or the
                output cannot be computed, is not finite, or too large for hair.
        """
        for what, name, known in (("graph", graph, OUT), ("output", output, OUT.get(graph, {}))):
            if name not in known:
                raise NeuralocksError(f"{what} {name!r}: is unknown; give one of {', '.join(known)}")
        if inputs.keys() != self._reads[graph].keys():
            raise NeuralocksError(f"{graph}: reads {', '.join(self._reads[graph])}; give just these arrays")
        inputs = {name: self._rows(graph, name, given) for name, given in inputs.items()}
        own = {name: len(rows) for name, rows in inputs.items() if name not in self._shared}
        count = next(iter(own.values()))
        if set(own.values()) != {count}:
            raise NeuralocksError(f"{graph}: is given {_named(own)} rows; give as many of each")
        try:
            return self._sane(graph, self._computed(graph, [output], inputs)[0], (count, OUT[graph][output]))
        except NeuralocksError:
            for name, rows in inputs.items():  # only now: NaN in what is read is NaN in what is given
                _check_finite(name, rows)
            raise

    def frame(self, vector: np.ndarray) -> dict[str, np.ndarray]:
        """What all strands share in a frame, from a boundary vector (spec.size,), by the tail's input names: `frame_part` (1, 256)
        float32, and more if the frame changes the weights of the tail (docs/architecture.md, The model file).

        Raises:
            NeuralocksError: it is not of this length or not of finite numbers, or the result cannot be computed, is not finite, or
                too large for hair.
        """
        values = self._computed("frame.onnx", list(self._shared), {"frame": self.vector(vector)[None]})
        return {
            name: self._sane("frame.onnx", value, (ROWS[name], self._shared[name]))
            for name, value in zip(self._shared, values)
        }

    def vector(self, given) -> np.ndarray:
        """A boundary vector that a caller gives, (spec.size,) float32.

        Raises:
            NeuralocksError: it is not of this length, or not of finite numbers.
        """
        wanted = f"({self.spec.size},)"
        vector = number_array("vector", given, f"{wanted} of a boundary vector", np.float32)
        if vector.shape != (self.spec.size,):
            raise NeuralocksError(f"vector: is of shape {vector.shape}; this model reads {wanted}")
        _check_finite("vector", vector)
        return vector

    def _rows(self, graph: str, name: str, given) -> np.ndarray:
        """An input of a graph that a caller gives, (n, width) float32."""
        width, count = self._reads[graph][name], ROWS.get(name, "n")
        rows = number_array(name, given, f"({count}, {width})", np.float32)
        if rows.ndim != 2 or rows.shape[1] != width or count not in ("n", len(rows)):
            raise NeuralocksError(f"{name}: is of shape {rows.shape}; {graph} reads ({count}, {width})")
        return rows

    def _check_graphs(self) -> None:
        """Refuse graphs that are not those of docs/architecture.md, before any of them is run.

        Raises:
            NeuralocksError: one has other inputs or outputs.
        """
        plain = [value.shape[1:] for value in self._sessions["strand.onnx"].get_inputs()] == [[PLAIN_STRAND]]
        self.strand_size = PLAIN_STRAND if plain else STRAND
        given = {value.name for value in self._sessions["frame.onnx"].get_outputs()}
        self._shared = OUT["frame.onnx"] | (CHANGED if given & set(CHANGED) else {})
        gives = OUT | {"frame.onnx": self._shared}
        self._reads = IN | {
            "strand.onnx": {"strand": self.strand_size},
            "frame.onnx": {"frame": self.spec.size},
            "tail.onnx": IN["tail.onnx"] | self._shared,
        }
        for name, session in self._sessions.items():
            for does, wanted, values in (
                ("reads", self._reads[name], session.get_inputs()),
                ("gives", gives[name], session.get_outputs()),
            ):
                found = {value.name: value.shape[-1] if value.shape else 1 for value in values}
                if found != wanted or any(value.type != "tensor(float)" for value in values):
                    raise NeuralocksError(
                        f"{self.file.path}: {name} {does} {_named(found)}, not {_named(wanted)}; get an undamaged copy"
                    )

    def _computed(self, graph: str, outputs: list[str], inputs: dict[str, np.ndarray]) -> list[np.ndarray]:
        try:
            return self._sessions[graph].run(outputs, inputs)
        except Exception as error:  # onnxruntime raises its own bare types for all errors in a graph
            raise NeuralocksError(
                f"{self.file.path}: {graph} cannot be computed ({_fact(error)}); get an undamaged copy of the model"
            ) from None

    def _sane(self, graph: str, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
        """The output of a graph, if it can be hair: NaN and infinity would spread into every file."""
        if values.shape != shape:
            raise NeuralocksError(
                f"{self.file.path}: {graph} gives {values.shape} numbers where {shape} belong; get an undamaged copy"
            )
        # A dot product with itself, still in the cache, costs a hundredth of computing the output; NaN compares false.
        if not np.vdot(values, values) <= LARGEST**2 * values.size:
            raise NeuralocksError(f"{self.file.path}: {graph} gives no finite hair; get an undamaged copy of the model")
        return values

    def by_chunk(self, function: Callable[[slice], None], count: int) -> None:
        """Call `function` with the slice of every chunk of `count` strands."""
        todo = chunks(count)
        left = iter(todo)

        def work() -> None:
            for chunk in left:
                function(chunk)

        # All threads, the caller's too, process chunks until none is left: waking one for each chunk costs more than a chunk.
        others = [self._pool.submit(work) for _ in range(min(self.threads, len(todo)) - 1)]
        try:
            work()
        finally:
            wait(others)
        for other in others:
            other.result()


def cores() -> int:
    """Threads that are worth starting: one per core, and at most eight, since each has arrays of its own."""
    return min(os.cpu_count() or 1, 8)


def chunks(count: int) -> list[slice]:
    """The chunks of `count` strands. They are the same in every frame and for any number of threads: the sums in a matrix
    product may depend on its height.
    """
    return [slice(low, min(low + CHUNK, count)) for low in range(0, count, CHUNK)]


def graph_session(file: model_file.ModelFile, name: str):
    """The onnxruntime session of one graph of a model.

    Raises:
        NeuralocksError: it has operations that no model of ours has, or onnxruntime cannot load it.
    """
    try:
        odd = odd_part(file.graphs[name])
    except ValueError as error:
        raise NeuralocksError(f"{file.path}: {name} cannot be loaded ({error}); get an undamaged copy") from None
    if odd:
        raise NeuralocksError(
            f"{file.path}: {name} has {odd}, as no model of this version has; get another copy, or update neuralocks"
        )
    # Its official builds report sessions and the models' names to their maker, and keep an identifier in the home folder,
    # unless this is set before the first import; if that came too late, and on Windows, the call below stops further reports.
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
    import onnxruntime

    onnxruntime.disable_telemetry_events()
    try:
        return _session(file.graphs[name])
    except Exception as error:  # onnxruntime raises its own bare types for all errors in a graph
        raise NeuralocksError(f"{file.path}: {name} cannot be loaded ({_fact(error)}); get an undamaged copy") from None


@lru_cache(maxsize=GRAPHS)
def _session(graph: bytes):
    """The session of a graph; threads and models may share it, for it keeps nothing between runs."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # the cores share chunks instead: no waiting between layers
    options.enable_cpu_mem_arena = False  # it keeps 13 MB in two threads, and saves at most a hundredth of the time
    options.log_severity_level = 4  # errors are raised anyway
    # Not its own format, which `odd_part` cannot read.
    options.add_session_config_entry("session.load_model_format", "ONNX")
    return onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])


def _check_finite(name: str, given: np.ndarray) -> None:
    if not np.isfinite(given).all():
        raise NeuralocksError(f"{name}: holds NaN or infinity; give finite numbers")


def _fact(error: Exception) -> str:
    return fact_of(error).rsplit("Status Message: ", 1)[-1][:120]


def _named(values: dict[str, int]) -> str:
    return ", ".join(f"{name} ({count})" for name, count in values.items())
