# SPDX-License-Identifier: Apache-2.0
"""Which model moves each groom of a shot: the one that was asked for, or whichever of the shipped ones suits it."""

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from neuralocks_core.deformation.model_choice import suited
from neuralocks_core.models.runtime import StrandModel

from ..shot.stage import StageGroom


class GroomModels:
    """The models of a shot's grooms, each read once.

    Args:
        given: path of a strand model; a StrandModel, which then moves every groom; None for the shipped ones.
        threads: as for `StrandModel`; a StrandModel that is given keeps its own if None.

    Raises:
        NeuralocksError: the file is missing, damaged, of a later format or not a model of strands.
    """

    def __init__(self, given: str | os.PathLike | StrandModel | None = None, threads: int | None = None):
        self._load = cache(lambda path: StrandModel.load(path, threads))
        self.asked = _of_threads(given, threads) if isinstance(given, StrandModel) else StrandModel.load(given, threads)
        """The one asked for; the shipped one that knows all styles if none was. All shipped ones read the same motion."""
        self._named = None if given is None else self.asked.file.path
        self._paths: dict[str, Path] = {}

    def path(self, item: StageGroom) -> Path:
        """The file of the model of a groom."""
        if item.path not in self._paths:
            self._paths[item.path] = suited(self._named, item.attachment.character, item.groom)
        return self._paths[item.path]

    def of(self, item: StageGroom) -> StrandModel:
        """The model of a groom."""
        path = self.path(item)
        return self.asked if path == self.asked.file.path else self._load(path)

    def each(self, grooms: Sequence[StageGroom]) -> list[tuple[StrandModel, list[StageGroom]]]:
        """Every model in use, with its grooms, in the order of the first of them."""
        found: dict[Path, list[StageGroom]] = {}
        for item in grooms:
            found.setdefault(self.path(item), []).append(item)
        return [(self.of(items[0]), items) for items in found.values()]


def _of_threads(model: StrandModel, threads: int | None) -> StrandModel:
    """A model itself, or the same one with another number of threads: loaded graphs are shared."""
    return model if threads in (None, model.threads) else StrandModel(model.file, threads)
