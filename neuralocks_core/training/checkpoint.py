# SPDX-License-Identifier: Apache-2.0
"""Checkpoints that survive a kill: one .npz of plain arrays, replaced atomically. No pickle."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import read_npz, replace_npz
from neuralocks_core.models.model_file import REMEDIES

KEPT = {
    "Adam": {"step", "exp_avg", "exp_avg_sq"},
    "AdamW": {"step", "exp_avg", "exp_avg_sq"},
    "Muon": {"momentum_buffer"},
}
"""State of each kind of optimiser per parameter: `step` is one number, all others have the parameter's shape."""


class _Unfit(ValueError):
    """Why a checkpoint does not fit, in a user's words."""


def save(
    path: Path, meta: dict, modules: dict[str, torch.nn.Module], optimisers: Sequence[torch.optim.Optimizer] = ()
) -> None:
    """Write modules, the state of optimisers and JSON values.

    Args:
        path: ends in `.npz`.
        meta: plain JSON values.
        modules: by name; all their parameters and buffers are saved.
        optimisers: of the kinds in KEPT.

    Raises:
        NeuralocksError: the file system refuses, or a number is not finite; the old file stays.
    """
    try:
        arrays = {"meta": np.frombuffer(json.dumps(meta, allow_nan=False).encode(), np.uint8)}
    except ValueError:
        raise _ran_away(path, "its measures") from None
    for name, module in modules.items():
        for key, value in module.state_dict().items():
            arrays[f"module/{name}/{key}"] = value.detach().cpu().numpy()
    for place, optimiser in enumerate(optimisers):
        for index, values in optimiser.state_dict()["state"].items():
            for key, value in values.items():
                arrays[f"optimiser/{place}/{index}/{key}"] = torch.as_tensor(value).detach().cpu().numpy()
    if odd := _not_finite(arrays):
        raise _ran_away(path, odd)
    replace_npz(path, arrays)


def load(
    path: Path,
    modules: dict[str, torch.nn.Module],
    optimisers: Sequence[torch.optim.Optimizer] = (),
    settings: dict | None = None,
    like: dict | None = None,
) -> dict:
    """Fill modules (and optimisers) from a checkpoint; returns its JSON values.

    Args:
        path, modules, optimisers: as for `save`.
        settings: must equal the saved JSON value of this name.
        like: other required JSON values, as examples of their kinds; numbers must not be negative.

    Raises:
        NeuralocksError: it is damaged, or belongs to other settings.
    """
    try:
        arrays = read_npz(path)
        meta = json.loads(arrays["meta"].tobytes())
        had = meta.get("settings", {}) if isinstance(meta, dict) else None
        if not isinstance(had, dict):
            raise _Unfit("damaged")
        if other := [name for name, value in (settings or {}).items() if had.get(name) != value]:
            raise _Unfit(f"it has other settings in {', '.join(other)}")
        if not all(name in meta and _alike(meta[name], value) for name, value in (like or {}).items()):
            raise _Unfit("damaged")
        if odd := _not_finite(arrays):
            raise _Unfit(f"NaN or infinity in {odd}")
        tensors = {name: torch.from_numpy(value) for name, value in arrays.items() if name != "meta"}
        for name, module in modules.items():
            prefix = f"module/{name}/"
            module.load_state_dict({k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)})
        for place, optimiser in enumerate(optimisers):
            _fill(optimiser, {k: v for k, v in tensors.items() if k.startswith(f"optimiser/{place}/")})
    except (ValueError, TypeError, KeyError, RuntimeError) as error:
        # Errors of numpy, json and torch about damage are written for programmers.
        fact = error if isinstance(error, _Unfit) else "another network" if type(error) is RuntimeError else "damaged"
        raise NeuralocksError(
            f"{path}: this checkpoint does not fit ({fact}); train without --resume, or with the settings it began with"
        ) from None
    return meta


def _alike(value, like) -> bool:
    """Whether a JSON value is of the kind of another; a number must not be negative, and must be an integer if the other is."""
    if type(like) not in (int, float):
        return type(value) is type(like)
    return type(value) in {int, type(like)} and 0 <= value < float("inf")


def _fill(optimiser: torch.optim.Optimizer, tensors: dict[str, torch.Tensor]) -> None:
    """Set the state of an optimiser, which has none before its first step.

    Raises:
        ValueError: the state belongs to other parameters or another optimiser.
    """
    state: dict[int, dict] = {}
    for name, value in tensors.items():
        index, key = name.split("/")[2:]
        state.setdefault(int(index), {})[key] = value
    if not state:
        return
    parameters = [p for group in optimiser.param_groups for p in group["params"]]
    for index, values in state.items():
        if not 0 <= index < len(parameters) or values.keys() != KEPT[type(optimiser).__name__]:
            raise _Unfit("another optimiser")
        for key, value in values.items():
            shape = () if key == "step" else parameters[index].shape
            if value.shape != shape or not value.is_floating_point():
                raise _Unfit(f"its optimiser has {tuple(value.shape)} numbers where {tuple(shape)} belong")
            if key in ("step", "exp_avg_sq") and (value < 0).any():  # a count, and squares
                raise _Unfit("damaged")
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})


def _not_finite(arrays: dict[str, np.ndarray]) -> str:
    """The first array with NaN or infinity, by its name; empty if there is none."""
    return next((k for k, v in arrays.items() if v.dtype.kind == "f" and not np.isfinite(v).all()), "")


def _ran_away(path: Path, where: str) -> NeuralocksError:
    return NeuralocksError(f"{path}: NaN or infinity in {where}; {REMEDIES['strands']}")
