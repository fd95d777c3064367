# SPDX-License-Identifier: Apache-2.0
"""Split inference compared with the same network on whole inputs, and with the machine's own matrix rate.

    python benchmarks/inference.py [MODEL] [--threads 2]

Times are medians of repeated calls, all in one run; compare the ratios, not the milliseconds of two machines. Run it
on an idle machine. It needs the extra `train`, which includes onnx. It takes about a minute.
"""

import argparse
import logging
import time
from pathlib import Path

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.models.network_sizes import HIDDEN, SHAPE

CHUNK = 512
MATRICES = ("middle", "out")
"""Weights that depend on the frame."""
clock = time.perf_counter


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--strands", type=int, nargs="+", default=[3000, 50000, 120000])
    parser.add_argument("--cpu-time", action="store_true", help="count CPU time, for a machine that is busy")
    arguments = parser.parse_args()
    global clock
    clock = time.process_time if arguments.cpu_time else time.perf_counter

    from neuralocks_core.models.runtime import StrandModel

    model = StrandModel.load(arguments.model, threads=arguments.threads)
    print(f"{model.file.path}, {arguments.threads} threads; milliseconds a frame")
    print(
        f"{'strands':>8} {'whole':>9} {'split':>9} {'int8':>9} {'floor':>9} | {'whole/split':>11} {'split/floor':>11}"
        f" | {'split error':>12} {'int8 error':>11}"
    )
    real, vector = shipped(model)
    whole, eight = whole_graph(model), quantised(model, vector)
    refused = half_refused()
    print(f"bfloat16 matrix products: {'refused by onnxruntime: ' + refused if refused else 'possible here'}")
    for strands in arguments.strands:
        session = Inputs(model, real, strands)
        a, whole_ms = timed(lambda s=session, v=vector: s.whole(whole, v))
        b, split_ms = timed(lambda s=session, v=vector: s.split(model, v))
        c, int8_ms = timed(lambda s=session, v=vector: s.split(model, v, eight))
        floor_ms = floor(strands, arguments.threads)
        print(
            f"{strands:8d} {whole_ms:9.2f} {split_ms:9.2f} {int8_ms:9.2f} {floor_ms:9.2f} | "
            f"{whole_ms / split_ms:11.2f} {split_ms / floor_ms:11.2f} | {np.abs(a - b).max():10.1e} m "
            f"{1000 * np.linalg.norm((c - b).reshape(-1, 3), axis=1).mean():8.2f} mm"
        )


class Inputs:
    """The shipped groom, its strands repeated up to one size, with everything that is computed once per groom."""

    def __init__(self, model, real, strands: int):
        from neuralocks_core.deformation.strand_session import strand_inputs
        from neuralocks_core.strands.strand_set import scalp_local

        take = np.arange(strands) % len(real.rest)
        codes = model.run("encoder.onnx", "code", shape=scalp_local(real).reshape(len(real.rest), -1))
        self.strand = strand_inputs(real, codes)[take, : model.strand_size]
        edges = np.zeros_like(real.rest)
        edges[:, 1:] = np.diff(real.rest, axis=1)
        self.edges = edges.reshape(len(edges), SHAPE)[take]
        self.anchor = np.zeros_like(self.edges)
        self.part = model.run("strand.onnx", "strand_part", strand=self.strand)

    def split(self, model, vector, tail=None) -> np.ndarray:
        """The network as the runtime runs it: the body's part once, then chunks of strands."""
        frame = model.frame(vector)
        result = np.empty_like(self.edges)
        if tail:

            def run(feed):
                return tail.run(["displacement"], {k: v for k, v in feed.items() if k not in MATRICES})[0]

        else:

            def run(feed):
                return model.run("tail.onnx", "displacement", **feed)

        def work(chunk):
            result[chunk] = run(
                {
                    "strand_part": self.part[chunk],
                    "anchor": self.anchor[chunk],
                    "edges": self.edges[chunk],
                    **frame,
                }
            )

        model.by_chunk(work, len(result))
        return result

    def whole(self, session, vector) -> np.ndarray:
        """The network as one: every strand's input holds the body too, all strands in one call."""
        inputs = np.concatenate([self.strand, np.broadcast_to(vector, (len(self.strand), len(vector)))], axis=1)
        return session.run(["displacement"], {"input": inputs, "anchor": self.anchor, "edges": self.edges})[0]


def shipped(model):
    """Strands of the shipped groom, and the boundary vector of the middle of the shipped shot."""
    from neuralocks_core.strands.strand_set import strands_on
    from usd.review.demo import shipped_shot
    from usd.shot.stage import read_shot

    item = read_shot(shipped_shot()).grooms[0]
    character, clip = item.attachment.character, item.attachment.rig.clip
    strands = strands_on(character, item.groom)
    return strands, model.sampler(character, clip).vectors([(clip.start + clip.end) / 2])[0]


def whole_graph(model):
    """One ONNX graph over (S, 142 + F): the network as it would run without the split, including deep maps."""
    import onnx
    import onnxruntime
    from onnx import compose, helper, numpy_helper

    parts = {name: onnx.load_from_string(model.file.graphs[f"{name}.onnx"]) for name in ("strand", "frame", "tail")}
    tail, nodes, weights, widths = parts["tail"].graph, [], list(parts["tail"].graph.initializer), []
    for name in ("strand", "frame"):
        graph = compose.add_prefix(parts[name], f"{name}/").graph
        widths.append(graph.input[0].type.tensor_type.shape.dim[1].dim_value)
        nodes += [*graph.node, helper.make_node("Identity", [f"{name}/{name}_part"], [f"{name}_part"])]
        weights += graph.initializer
    weights.append(numpy_helper.from_array(np.array(widths, np.int64), "widths"))
    split = helper.make_node("Split", ["input", "widths"], ["strand/strand", "frame/frame"], axis=1)
    nodes = [split, *(n for n in nodes if n.output[0].split(".")[-1] not in (*ONE_FRAME, "frame/middle", "frame/out"))]
    for node in tail.node:
        nodes += own_weights(node, helper.make_node)
    inputs = [
        helper.make_tensor_value_info("input", onnx.TensorProto.FLOAT, ["S", sum(widths)]),
        *(i for i in tail.input if i.name in ("anchor", "edges")),
    ]
    graph = helper.make_graph(nodes, "whole", inputs, list(tail.output), weights)
    whole = helper.make_model(graph, opset_imports=parts["tail"].opset_import, ir_version=parts["tail"].ir_version)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = model.threads
    return onnxruntime.InferenceSession(whole.SerializeToString(), options, providers=["CPUExecutionProvider"])


ONE_FRAME = ("weighed", "change", "whole", "rows")
"""Results of the frame's graph for the weights that follow; all strands share them only if they share the frame."""


def own_weights(node, make) -> list:
    """A node of the tail for strands that each have a frame of their own."""
    if node.op_type != "Gemm" or node.input[1] not in MATRICES:
        return [node]
    value, name, bias = node.input
    return [
        make("Mul", [value, f"frame/{name}.factor"], [f"{name}.scaled"]),
        make("Gemm", [f"{name}.scaled", f"frame/{name}.plain", bias], [f"{name}.flat"]),
        make("MatMul", [f"{name}.scaled", f"frame/{name}.to_terms"], [f"{name}.terms"]),
        make("Mul", [f"{name}.terms", f"frame/{name}.weights"], [f"{name}.weighed"]),
        make("MatMul", [f"{name}.weighed", f"frame/{name}.back"], [f"{name}.change"]),
        make("Add", [f"{name}.flat", f"{name}.change"], node.output),
    ]


def quantised(model, vector):
    """The tail with dynamic 8-bit matrix products for one frame."""
    import tempfile

    import onnx
    import onnxruntime
    from onnx import numpy_helper
    from onnxruntime.quantization import QuantType, quantize_dynamic

    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "tail.onnx", Path(folder) / "tail8.onnx"
        proto = onnx.load_from_string(model.file.graphs["tail.onnx"])
        for name in MATRICES:
            proto.graph.initializer.append(numpy_helper.from_array(model.frame(vector)[name], name))
        kept = [value for value in proto.graph.input if value.name not in MATRICES]
        del proto.graph.input[:]
        proto.graph.input.extend(kept)
        for number, node in enumerate(proto.graph.node):
            node.name = node.output[0] or str(number)
        onnx.save(proto, source)
        sums = [n.name for n in proto.graph.node if n.op_type == "MatMul"]  # their errors add up along the strand
        quantize_dynamic(source, target, weight_type=QuantType.QInt8, nodes_to_exclude=sums, per_channel=True)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        return onnxruntime.InferenceSession(target.read_bytes(), options, providers=["CPUExecutionProvider"])


def half_refused() -> str:
    """Why onnxruntime's CPU provider cannot multiply matrices in bfloat16 here; empty if it can."""
    import onnxruntime
    from onnx import TensorProto, helper

    kind = TensorProto.BFLOAT16
    values = [helper.make_tensor_value_info(name, kind, [HIDDEN, HIDDEN]) for name in "xwy"]
    graph = helper.make_graph([helper.make_node("MatMul", ["x", "w"], ["y"])], "half", values[:2], values[2:])
    proto = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    try:
        onnxruntime.InferenceSession(proto.SerializeToString(), providers=["CPUExecutionProvider"])
    except Exception as error:
        return str(error).splitlines()[0][:100]
    return ""


def floor(strands: int, threads: int) -> float:
    """Milliseconds that the two remaining matrix products would take at the best rate of this machine's matrix library."""
    from concurrent.futures import ThreadPoolExecutor

    import onnxruntime
    from onnx import TensorProto, helper, numpy_helper

    rng = np.random.default_rng(0)
    weight = rng.normal(size=(HIDDEN, HIDDEN)).astype(np.float32)
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["x", "w"], ["y"])],
        "product",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, [CHUNK, HIDDEN])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, [CHUNK, HIDDEN])],
        [numpy_helper.from_array(weight, "w")],
    )
    proto = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(proto.SerializeToString(), options, providers=["CPUExecutionProvider"])
    x = rng.normal(size=(CHUNK, HIDDEN)).astype(np.float32)
    with ThreadPoolExecutor(threads) as pool:

        def burst():
            list(pool.map(lambda _: session.run(None, {"x": x}), range(64)))

        _, once = timed(burst)
    work = strands * (HIDDEN * HIDDEN + HIDDEN * SHAPE)
    return once * work / (64 * CHUNK * HIDDEN * HIDDEN)


def timed(function, seconds: float = 1.5):
    """The result, and the median wall time of a call [ms]."""
    result = function()
    spent = []
    while sum(spent) < seconds and len(spent) < 200 or len(spent) < 5:
        start = clock()
        result = function()
        spent.append(clock() - start)
    return result, 1000 * float(np.median(spent))


if __name__ == "__main__":
    main()
