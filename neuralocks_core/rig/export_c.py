# SPDX-License-Identifier: Apache-2.0
"""A rig model as one self-contained C99 header for engines, and a worked example beside it."""

import hashlib
import re
import shlex
from pathlib import Path

import numpy as np

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.network import POSE, RigModel, rig_spec
from neuralocks_core.rotation import rotation_part, to_quaternion

_TEXTS = Path(__file__).parent
_AT_ONCE = 8
"""Rows of a layer that are summed at a time: with more, SSE has no registers left for the inputs that they are multiplied with."""
_WIDTH = 8
"""Columns of a layer are a multiple of this, the width of vector units."""
_ENTRIES = 128
"""Of the history in history.h.in, a power of two."""
_FINEST = 2.0**17
"""Units of the history's numbers are at least this fine: the shortest step that a push takes, 1e-5 s, must not be zero."""
HISTORY_BYTES = 5_768
"""Size of the struct of history.h.in; a dynamic model needs one per character."""
MADE = "Made by `neuralocks rig export-c`"
"""Text in the first lines of both files."""


def made_here(path) -> bool:
    """Whether a file is a header, or a worked example, that `export_c` wrote."""
    try:
        with open(path, encoding="utf-8") as file:
            return MADE in file.read(1000)
    except UnicodeDecodeError:
        return False


def export_c(model: RigModel, path, prefix: str = "nl_hair") -> Path:
    """Write `path` (ends in .h or .hpp) and `example_beside` it.

    Args:
        model: the trained model.
        path: header to write.
        prefix: prefix of every name in it, so that one program can use several models.

    Raises:
        NeuralocksError: the name or the prefix cannot be used, the folder cannot be written, a file of somebody else's has the
            header's or the example's name, the model reads inputs that the header does not compute or clamps those of a pose, or its
            history is too long.
    """
    path = Path(path)
    if path.suffix not in (".h", ".hpp"):
        raise NeuralocksError(f"{path}: a header ends in .h or .hpp; choose such a name")
    if re.search(r'^-|["\\\x00-\x1f\ud800-\udfff]', path.name):  # the last are bytes that are no letters
        raise NeuralocksError(
            f"{path.name!r}: no #include or compiler can name it; choose one without quotes, backslashes, broken letters, a dash in front"
        )
    beside = example_beside(path)
    for file, what in ((path, "header"), (beside, "worked example")):
        if file.is_file() and not made_here(file):
            raise NeuralocksError(f"{file}: would be overwritten by the {what}; move it, or name another header")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,40}", prefix):
        raise NeuralocksError(f"--prefix {prefix}: give a letter, then up to 40 letters without accents, digits and _")
    known = rig_spec(model.dynamic)
    read_alike = all(getattr(model.spec, name) == getattr(known, name) for name in ("pose_joints", "linear", "chest"))
    if not read_alike:
        raise NeuralocksError("model: it reads other inputs than a header computes; train it with neuralocks rig train")
    if (least := model.limits[: POSE - 3].min()) < 1.01:
        raise NeuralocksError(
            f"model: it clamps entries of rotations to {least:.3g}, a header leaves them as they are, up to 1; "
            "give it the limits of neuralocks_core.rig.network.input_limits, or train it with neuralocks rig train"
        )
    for target, text in (
        (path, header_text(model, prefix)),
        (beside, _example(model, path.name, prefix)),
    ):
        with atomic_write(target) as part:
            part.write_text(text, encoding="utf-8", newline="\n")
    return path


def example_beside(path: Path) -> Path:
    """The file of the worked example of a header: C++ beside an .hpp, else C."""
    return path.with_name(f"{path.stem}_example.{'cpp' if path.suffix == '.hpp' else 'c'}")


def header_text(model: RigModel, prefix: str = "nl_hair") -> str:
    """The text of the header: the templates rig/hair.h.in and, for a dynamic model, rig/history*.h.in, filled in."""
    text = (_TEXTS / "hair.h.in").read_text(encoding="utf-8")
    parts = ("history.h.in", "history_read.h.in") if model.dynamic else ()
    text = text.replace("@HISTORY@", "".join((_TEXTS / part).read_text(encoding="utf-8") for part in parts))
    text = _parts_for(model, text)
    chains = model.chains
    size = np.float32(np.sin(model.max_angle / 2))
    layers = _padded(model.layers, len(chains))
    values = {
        "PREFIX": prefix,
        "UPPER": prefix.upper(),
        "DIGEST": _digest(model),
        "JOINTS": len(chains),
        "FEATURES": model.inputs,
        "NAMES": ", ".join(f'"{_c_text(n)}"' for n in chains.names),
        "PARENTS": ", ".join(str(int(p)) for p in chains.parents),
        "BINDS": ", ".join("{" + ", ".join(_float(v) for v in q) + "}" for q in _binds(chains)),
        "CHAINS": _plain(", ".join(chains.chain_name(c) for c in range(len(chains.roots)))),
        "READS": _reads(model),
        "FACING": _facing(model),
        "DEGREES": f"{np.degrees(model.max_angle):.0f}",
        "WIDTH": layers[-1][0].shape[1] // 3,
        "LIMITS": ", ".join(_float(v) for v in model.limits),
        "SIZE": _float(size),
        "SIZE2": _float(size * size),
        "FLOOR": _float(np.float32(1) - size * size),
        **_history(model.spec),
        **_network(layers, prefix),
    }
    return re.sub(r"@([A-Z0-9]+)@", lambda match: str(values[match[1]]), text)


def _history(spec: BoundarySpec) -> dict[str, str]:
    """What the history's templates say of the bins. Its times and integrals are 32-bit integers, as fine as these allow if no
    difference that a read takes reaches round half the range.

    Raises:
        NeuralocksError: bins or the whole history are so long that the numbers would be too coarse.
    """
    longest, widest = (spec.steps + 2) * spec.dt, max(spec.bins, default=0) * spec.dt
    # Ends of a bin in different entries differ by whole entries. Two pauses hold 6 g of a kick each, one also gravity and wind, of
    # 3 g along each axis; frames beside them in the bin as much of both. Frames alone turn by at most 100 rad/s, and 500 of them a
    # second pass on at most 6 g for a step in each.
    grown = max((12 + 3**1.5) * longest + 12 * widest, max(100, 500 * 6 * spec.dt) * widest, 32)
    unit = 2.0 ** np.floor(np.log2(2**31 / grown))
    if unit < _FINEST:
        raise NeuralocksError(
            f"model: its history of {longest:.0f} s, in bins of up to {widest:.0f} s, is too long for a header's numbers; "
            "train it with shorter bins, as neuralocks rig train does"
        )
    ends, half = np.round(unit * spec.dt * np.cumsum((0, *spec.bins))).astype(int), int(unit * spec.dt / 2)
    # Ends of the bins before the newest push: of gravity, of the turn and of velocity, which are read half a step apart.
    lags = np.concatenate([[0], ends[1:] - half, ends, ends + half])
    lags = np.pad(lags, (0, -len(lags) % 4), mode="edge")
    return {
        "BINS": str(len(spec.bins)),
        "ENTRIES": str(_ENTRIES),
        "REACH": f"{spec.steps * spec.dt:.3g}",
        "UNIT": _float(unit),
        "APART": str(int(unit * (spec.steps + 1) * spec.dt / (_ENTRIES - 2))),
        "LONGEST": _float(longest),
        "LOOKUPS": str(len(lags)),
        "LAGS": ", ".join(str(lag) for lag in lags),
        "TAPER": ", ".join(_float(v) for v in spec.bin_weights),
        "RATES": ", ".join(_float(1 / (unit * spec.dt * b)) for b in spec.bins),
        "DT": _float(spec.dt),
        "HALF": _float(spec.dt * unit / 2),
    }


def _binds(chains: HairChains) -> np.ndarray:
    """Bind axes of the joints as quaternions (N, 4) wxyz.

    Raises:
        NeuralocksError: some are mirrored or flat, which no training has.
    """
    return to_quaternion(rotation_part(chains.axes, "model: bind axes of its joints"))


def _digest(model: RigModel) -> str:
    """The digest by which a compiler tells two models apart."""
    digest = hashlib.sha256(repr(model.chains.names).encode("utf-8", "replace"))
    for array in (model.limits, *(each for layer in model.layers for each in layer)):
        digest.update(array.tobytes())
    return digest.hexdigest()[:12].upper()


def _network(layers: list[tuple[np.ndarray, np.ndarray]], prefix: str) -> dict[str, str]:
    """C text of the padded layers: weights, buffers of their outputs, loops, and the last buffer's name."""
    tables, buffers, code, below = [], [], [], "x"
    for index, (weight, bias) in enumerate(layers):
        rows, columns = weight.shape
        table = ",\n".join(" {" + ", ".join(_float(v) for v in row) + "}" for row in weight)
        tables.append(f"  static const float w{index}[{rows}][{columns}] = {{\n{table}}};")
        tables.append(f"  static const float b{index}[{columns}] = {{{', '.join(_float(v) for v in bias)}}};")
        buffers.append(f"  float h{index}[{columns}];")
        code += _layer(index, rows, columns, below, f"{prefix}_positive" if index + 1 < len(layers) else "")
        below = f"h{index}"
    return {"TABLES": "\n".join(tables), "BUFFERS": "\n".join(buffers), "LAYERS": "\n".join(code), "RAW": below}


def _padded(layers, joints: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Weights (in, out) and biases of the C layers, columns of zeros added so that no loop has a remainder.

    The last layer gives x of all joints, then y, then z, so that many joints are turned at once.
    """
    result = []
    for index, (weight, bias) in enumerate(layers):
        count = len(bias)
        if index + 1 < len(layers):
            place, columns = np.arange(count), _round_up(count, _WIDTH)
        else:
            width = _round_up(joints, _WIDTH)
            place, columns = (np.arange(joints)[:, None] + width * np.arange(3)).ravel(), 3 * width
        padded, biases = np.zeros((weight.shape[1], columns), np.float32), np.zeros(columns, np.float32)
        padded[:, place] = weight.T
        biases[place] = bias
        result.append((padded, biases))
    return result


def _round_up(count: int, unit: int) -> int:
    return -(-count // unit) * unit


def _layer(index: int, rows: int, columns: int, below: str, activation: str) -> list[str]:
    """Lines of a layer: loops over columns, whose constant lengths vectorise, each for a block of rows.

    Products are added in pairs, and blocks from the last row to the first, so that single precision suffices: the first layer has
    over a hundred terms, and its largest, those of the pose, come last.
    """
    *others, first = (range(at, min(at + _AT_ONCE, rows)) for at in reversed(range(0, rows, _AT_ONCE)))
    loop, value, total = f"  for (k = 0; k < {columns}; ++k)", f"h{index}[k]", f"b{index}[k]"
    lines = []
    if others:
        lines.append(f"{loop} {value} = {total} + {_products(index, below, others[0])};")
        total = value
    if others[1:]:
        lines.append(f"  for (i = {others[1][0]}; i > 0; i -= {_AT_ONCE})")
        lines.append(f"  {loop} {value} += {_products(index, below, range(_AT_ONCE), 'i + ')};")
    total += f" + {_products(index, below, first)}"
    return [*lines, f"{loop} {value} = {activation}({total});" if activation else f"{loop} {value} = {total};"]


def _products(index: int, below: str, rows: range, start: str = "") -> str:
    """The sum of some rows of column k, each with its input, added in pairs of pairs."""
    if len(rows) == 1:
        return f"w{index}[{start}{rows[0]}][k] * {below}[{start}{rows[0]}]"
    half = (len(rows) + 1) // 2
    return f"({_products(index, below, rows[:half], start)} + {_products(index, below, rows[half:], start)})"


def _parts_for(model: RigModel, text: str) -> str:
    """A template without its markers; for a quasi-static model also without the text between @IF_DYNAMIC@ and @END@."""
    return re.sub(r"@IF_DYNAMIC@\n(.*?)@END@\n", r"\1" if model.dynamic else "", text, flags=re.S)


def _example(model: RigModel, header: str, prefix: str) -> str:
    text = _parts_for(model, (_TEXTS / "example.c.in").read_text(encoding="utf-8"))
    beside = example_beside(Path(header))
    names = {
        "COMPILER": "c++ -std=c++11" if beside.suffix == ".cpp" else "cc -std=c99",
        "HEADER": header,
        "SOURCE": shlex.quote(beside.name),
        "PROGRAM": shlex.quote(beside.stem),
        "PREFIX": prefix,
        "UPPER": prefix.upper(),
    }
    return re.sub("@([A-Z]+)@", lambda m: names[m[1]], text)


def _reads(model: RigModel) -> str:
    """A line of the header's comment that names the joints of the inputs, if the model file has their names."""
    reads = model.training.get("reads")
    if not isinstance(reads, dict) or not all(isinstance(name, str) for name in reads.values()):
        return ""
    named = ", ".join(f"{part.replace('_', ' ')} {name}" for part, name in reads.items())
    return f" *   the joints that it reads, as they are named in its rig: {_plain(named)}\n"


def _facing(model: RigModel) -> str:
    """Lines of the header's comment on which way the model's rig faces in its own file, if the model file says so."""
    angle = model.training.get("facing")
    if not isinstance(angle, int | float) or not -180 <= angle <= 180:
        return ""
    if abs(angle) < 0.05:
        return " *               (in the file of the rig that the model was trained for, with Y up, it does)\n"
    return (
        " *               (in the file of the rig that the model was trained for, with Y up, the bind pose must be turned by\n"
        f" *               {angle:.1f} degrees about +Y for that)\n"
    )


def _plain(text: str) -> str:
    """A list that is safe in a comment, whoever made the model, in plain ASCII: a compiler may read it in any code page."""
    if len(text) > 300:
        text = f"{text[:300].rpartition(', ')[0] or text[:300]}, ..."
    return re.sub(r"[^\w ,.:-]", "_", text).encode("ascii", "backslashreplace").decode()


def _float(value) -> str:
    text = str(np.float32(value))
    return (text if "." in text or "e" in text else f"{text}.0") + "f"


def _c_text(name: str) -> str:
    """A name as UTF-8 inside a C string literal, in plain ASCII: octal escapes end after three digits."""
    plain = [chr(byte).isalnum() or chr(byte) in " _-.:" for byte in range(128)] + [False] * 128
    return "".join(chr(byte) if plain[byte] else f"\\{byte:03o}" for byte in name.encode("utf-8", "replace"))
