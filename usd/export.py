# SPDX-License-Identifier: Apache-2.0
"""Unpack a model for other runtimes: plain ONNX files and a description of their inputs."""

import json
from contextlib import ExitStack
from pathlib import Path

from neuralocks_core import model as model_file
from neuralocks_core.files import atomic_write

UNITS = "SI units, float32; canonical space: origin at the head joint, Y up, the bind pose faces +Z"

STRANDS = {
    "encoder.onnx": "once a groom: `shape` (S, 72), root-relative points of 24 vertices in scalp axes [m] "
    "-> `code` (S, 32)",
    "strand.onnx": "once a groom: `strand` (S, 70): root UV 2, own code 32, mean code of its lock 32, root normal 3, "
    "length 1 [m] -> `strand_part` (S, 256)",
    "frame.onnx": "once a frame: `frame` (1, F), the boundary vector -> `frame_part` (1, 256), and where the frame "
    "changes the weights behind, `middle` (256, 256) and `out` (256, 72); `material` in it are logarithms of the ratios to "
    "the default bend, weight and damping, and 0: clumping is no input, it scales how far a hair's displacement lies from "
    "that of its lock's mean strand, by ((clumping + 20) / 80)^-0.85",
    "tail.onnx": "per strand and frame: `strand_part` (S, 256), all that `frame.onnx` gave, `anchor` (S, 72): the `offsets` "
    "answered for the held bind pose (zeros where the model is not anchored), `edges` (S, 72): rest[i] - rest[i-1] "
    "with row 0 zero [m] -> `offsets` (S, 72), `displacement` (S, 72) in canonical space [m]",
}


def export_model(model, folder) -> list[Path]:
    """Write the graphs and `description.json` of a model file into a folder.

    Args:
        model: path of a `.neuralocks` file.
        folder: made if it does not exist; files of the same names are replaced.

    Returns:
        The files written.

    Raises:
        NeuralocksError: the model cannot be read or the folder not be written.
    """
    file = model_file.read(model)
    folder = Path(folder)
    description = {"units": UNITS, "graphs": _graphs(file), "model": file.meta}
    if file.kind == "strands":
        from neuralocks_core.boundary import BoundarySpec
        from neuralocks_core.measures import MEASURES

        spec = BoundarySpec.from_json(file.meta.get("boundary") or {})
        parts = {name: [part.start, part.stop] for name, part in spec.slices.items()}
        description["boundary vector"] = {
            "length": spec.size,
            "parts": parts,
            "pose joints": spec.pose_joints,
            "shape": MEASURES,
        }
    files = dict(file.graphs) | {"description.json": json.dumps(description, indent=1).encode()}
    with ExitStack() as all_or_none:
        for name, data in files.items():
            all_or_none.enter_context(atomic_write(folder / name)).write_bytes(data)
    return [folder / name for name in files]


def _graphs(file: model_file.ModelFile) -> dict:
    from neuralocks_core.runtime import graph_session

    result = {}
    for name in file.graphs:
        session = graph_session(file, name)
        result[name] = {
            "what": STRANDS.get(name, ""),
            "inputs": {i.name: i.shape for i in session.get_inputs()},
            "outputs": {o.name: o.shape for o in session.get_outputs()},
        }
    return result
