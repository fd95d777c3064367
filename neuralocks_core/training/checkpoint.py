# SPDX-License-Identifier: Apache-2.0
"""Checkpoints that survive a kill: one .npz of plain arrays, replaced at once. No pickle."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import replace_npz


def save(
    path: Path, meta: dict, modules: dict[str, torch.nn.Module], optimisers: Sequence[torch.optim.Optimizer] = ()
) -> None:
    """Write modules, the state of optimisers and JSON values.

    Args:
        path: ends in `.npz`.
        meta: plain JSON values.
        modules: by name; all their parameters and buffers are kept.
        optimisers: whose state is tensors and numbers, as that of all in torch.

    Raises:
        NeuralocksError: the file system refuses.
    """
    arrays = {"meta": np.frombuffer(json.dumps(meta).encode(), np.uint8)}
    for name, module in modules.items():
        for key, value in module.state_dict().items():
            arrays[f"module/{name}/{key}"] = value.detach().cpu().numpy()
    for place, optimiser in enumerate(optimisers):
        for index, values in optimiser.state_dict()["state"].items():
            for key, value in values.items():
                arrays[f"optimiser/{place}/{index}/{key}"] = torch.as_tensor(value).detach().cpu().numpy()
    replace_npz(path, arrays)


def load(
    path: Path,
    modules: dict[str, torch.nn.Module],
    optimisers: Sequence[torch.optim.Optimizer] = (),
    settings: dict | None = None,
) -> dict:
    """Fill modules (and optimisers) from a checkpoint; returns its JSON values.

    Args:
        path, modules, optimisers: as for `save`.
        settings: must be what was saved as the JSON value of this name.

    Raises:
        NeuralocksError: it is damaged, or belongs to other settings.
    """
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        meta = json.loads(arrays["meta"].tobytes())
        had = meta.get("settings", {})
        if other := [name for name, value in (settings or {}).items() if had.get(name) != value]:
            raise ValueError(f"it has other settings in {', '.join(other)}")
        for name, module in modules.items():
            prefix = f"module/{name}/"
            values = {k.removeprefix(prefix): torch.from_numpy(v) for k, v in arrays.items() if k.startswith(prefix)}
            module.load_state_dict(values)
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile) as error:
        fact = "damaged" if "allow_pickle" in str(error) else str(error).splitlines()[0]
        raise NeuralocksError(
            f"{path}: this checkpoint does not fit ({fact}); train without --resume, or with the settings it began with"
        ) from None
    for place, optimiser in enumerate(optimisers):
        state: dict[int, dict] = {}
        for name, value in arrays.items():
            if name.startswith(f"optimiser/{place}/"):
                index, key = name.split("/")[2:]
                state.setdefault(int(index), {})[key] = torch.from_numpy(value)
        if state:
            optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
    return meta
