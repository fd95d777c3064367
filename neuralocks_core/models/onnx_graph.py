# SPDX-License-Identifier: Apache-2.0
"""Writing ONNX graphs node by node, and reading their weights; needs the extra `train`."""

import numpy as np

from neuralocks_core.errors import NeuralocksError, fact_of

OPSET = 17
IR_VERSION = 8
"""The file's version: the oldest that OPSET allows, for the oldest onnxruntime that a user may have."""


class OnnxGraph:
    """A graph under construction; values are identified by name.

    Args:
        name: of the graph.
        remedy: what a user can do about weights that are not finite.

    Raises:
        NeuralocksError: onnx is not installed.
    """

    def __init__(self, name: str, remedy: str):
        try:
            from onnx import helper, numpy_helper
        except ImportError:
            raise NeuralocksError(
                'onnx: not installed, it writes the model\'s graph; pip install "neuralocks[train]"'
            ) from None
        self.helper, self.numpy_helper = helper, numpy_helper
        self.name, self.remedy, self.nodes, self.constants = name, remedy, [], []

    def constant(self, name: str, array: np.ndarray) -> str:
        """Add an array under this name; returns the name.

        Raises:
            NeuralocksError: it holds NaN or infinity, as after a training that diverged.
        """
        if not np.isfinite(array).all():
            raise NeuralocksError(f"{self.name}: NaN or infinity in {name}; {self.remedy}")
        self.constants.append(self.numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def node(self, kind: str, inputs: list[str], output: str, **attributes) -> str:
        """Add one ONNX operation; returns the name of its only output."""
        self.nodes.append(self.helper.make_node(kind, inputs, [output], **attributes))
        return output

    def finish(self, inputs: dict[str, tuple], outputs: dict[str, tuple]) -> bytes:
        """The checked graph; inputs and outputs are names -> shapes, where a name in a shape stands for any size."""
        import onnx

        def describe(values):
            return [self.helper.make_tensor_value_info(k, onnx.TensorProto.FLOAT, v) for k, v in values.items()]

        graph = self.helper.make_graph(self.nodes, self.name, describe(inputs), describe(outputs), self.constants)
        model = self.helper.make_model(
            graph,
            opset_imports=[self.helper.make_opsetid("", OPSET)],
            ir_version=IR_VERSION,
            producer_name="neuralocks",
        )
        onnx.checker.check_model(model)
        return model.SerializeToString(deterministic=True)


class OnnxWeights:
    """The weights of a graph.

    Attributes:
        constants: arrays by name, all in float32; those stored in float16 have the name that the computation uses.
        layers: (in, out) weight and (out,) bias of the linear layers, by the name of their output, in the order in which they
            are computed.

    Args:
        graph: the ONNX file.
        name: what messages call it.

    Raises:
        NeuralocksError: it is damaged, or its numbers are in other files.
    """

    def __init__(self, graph: bytes, name: str):
        import onnx
        from google.protobuf.message import DecodeError

        try:
            graph = onnx.load_model_from_string(graph).graph
            if any(tensor.data_location == onnx.TensorProto.EXTERNAL for tensor in graph.initializer):
                raise ValueError("its numbers lie in another file")
            arrays = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in graph.initializer}
            self.constants = {k.removesuffix(".half"): np.array(v, np.float32) for k, v in arrays.items()}
            gemms = [
                node for node in graph.node if node.op_type == "Gemm" and f"{node.output[0]}.weight" in self.constants
            ]
            self.layers = {
                node.output[0]: (self.constants[f"{node.output[0]}.weight"], self.constants[f"{node.output[0]}.bias"])
                for node in gemms
            }
        except (DecodeError, ValueError, TypeError, KeyError, IndexError) as error:
            raise NeuralocksError(f"{name}: damaged ({fact_of(error)}); get an undamaged copy") from None
