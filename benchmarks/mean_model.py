# SPDX-License-Identifier: Apache-2.0
"""The mean of a model and of one that started from it: often better than both, if a longer training with larger steps has
left the valley of the first.

    python benchmarks/mean_model.py MODEL BEGUN SHARE [--damping FACTOR] [--without GROOM ...] [--also OTHER GROOM ...] -o OUT

SHARE is the share of BEGUN, from 0 to 1. Both share their strand codes, which stay. With `--damping`, MODEL is first made to
take so many times the damping for what it is told: a model that learned from a solver whose steps damp, before it is mixed
with one that did not. The card is that of BEGUN and says so, without the measurements of BEGUN. With `--without`, the card
does not tell of the hair of some grooms, by their numbers in the training of BEGUN, from 0 on: for those that another shipped
model moves better, so that hair like it does not get this one (`deformation/model_choice.py`); without all of it, the model is for
hair that is like none. With `--also`, it tells of the hair of some grooms in the card of another model, too, which this one
moves as well: hair that it began with, or in place of that model.
"""

from __future__ import annotations

import argparse
import math
from copy import deepcopy
from pathlib import Path

import plain_errors  # noqa: F401
import torch

from neuralocks_core.materials import RANGES
from neuralocks_core.strands.resemblance import KEPT, spread


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("begun", type=Path)
    parser.add_argument("share", type=float)
    parser.add_argument("--damping", type=float, default=1.0)
    parser.add_argument("--without", type=int, nargs="+", default=[], metavar="GROOM")
    parser.add_argument("--also", nargs="+", action="append", default=[], metavar=("OTHER", "GROOM"))
    parser.add_argument("-o", "--out", type=Path, required=True)
    print(mean(**vars(parser.parse_args())))


def mean(
    model: Path, begun: Path, share: float, damping: float, without: list[int], also: list[list[str]], out: Path
) -> Path:
    """Write the model whose weights are (1 - share) of `model`'s, at so many times its damping, and `share` of `begun`'s; its card
    does not tell of the hair of the grooms `without`, and tells of those of other models in `also`.
    """
    from neuralocks_core.boundary.spec import BoundarySpec
    from neuralocks_core.models import model_file
    from neuralocks_core.training.export import strand_graphs
    from neuralocks_core.training.networks import StrandNet
    from neuralocks_core.training.warm_start import Beginning

    meta = model_file.read(begun, "strands").meta
    spec = BoundarySpec.from_json(meta["boundary"])
    kind = {name: meta["training"]["options"][name] for name in ("motion", "strand_map")}
    second = StrandNet(spec.size, **kind)
    Beginning(begun).fill(second)
    first = deepcopy(second)  # a deep map that the model lacks outputs zero, with the other's hidden layers
    Beginning(model).fill(first)
    with torch.no_grad():
        # in normalised units, a constant that is added to the logarithm of damping is one that is added to each bias
        place = spec.slices["material"].start + list(RANGES).index("damping")
        shift = float(first.frame_scale[place]) * math.log(damping)
        for layer in (first.frame, *list(first.encoder or ())[:1]):
            layer.bias.add_(shift * layer.weight[:, place])
        for ours, theirs in zip(first.parameters(), second.parameters(), strict=True):
            ours.lerp_(theirs, share)
    began = "those that it began with" + (f", at {damping:g} times their damping" if damping != 1 else "")
    training = {**meta["training"], "mean": f"{share:g} of these weights, {1 - share:g} of {began}"}
    if without or also:
        told = [rows for i, rows in enumerate(_grooms(training)) if i not in without]
        for other, *chosen in also:
            rows = _grooms(model_file.read(Path(other), "strands").meta["training"])
            told += [rows[int(i)] for i in chosen]
        training["hair"] = [rows[i] for rows in told for i in spread(len(rows), KEPT // len(told))]
        if not told:
            del training["hair"]
    graphs = strand_graphs(Beginning(begun).coder(), first, meta["output"])
    return model_file.write(out, {**meta, "training": training, "report": {}}, graphs)


def _grooms(training: dict) -> list[list[str]]:
    """The strands that a card tells of each groom: as many of each."""
    each = len(training["hair"]) // len(training["strands"])
    return [training["hair"][i * each : (i + 1) * each] for i in range(len(training["strands"]))]


if __name__ == "__main__":
    main()
