# SPDX-License-Identifier: Apache-2.0
"""Training that starts from another model: from a model file back to torch modules."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError, about, fact_of
from neuralocks_core.models import model_file
from neuralocks_core.models.network_sizes import K
from neuralocks_core.models.onnx_graph import OnnxWeights
from neuralocks_core.training import checkpoint
from neuralocks_core.training.autoencoder import StrandAutoencoder
from neuralocks_core.training.networks import StrandNet, smoothing
from neuralocks_core.training.work_folder import BEGINNING, CODES


class Beginning:
    """The weights of a strand model; the inverse of `export.strand_graphs`.

    Args:
        path: the model file.

    Raises:
        NeuralocksError: it is damaged, or not a model for strands.
    """

    def __init__(self, path: str | Path):
        file = model_file.read(path, "strands")
        self.path, self._meta = file.path, file.meta
        self._graphs = {name: OnnxWeights(graph, f"{path}: {name}") for name, graph in file.graphs.items()}

    @property
    def credits(self) -> list[str]:
        """Whose data the model has learned from."""
        return list(self._meta["credits"])

    def card(self) -> dict:
        """How the model was made, for the card of a training that starts from it."""
        training = self._meta["training"]
        return {
            name: training[name]
            for name in ("command", "minutes", "steps", "mean", "livelier", "began", "began with")
            if name in training
        }

    def check(self, spec: BoundarySpec, options, resume: bool) -> None:
        """Refuse a training, begun or resumed, whose network is of a different kind from the model's; see `differences`.

        Raises:
            NeuralocksError: the model has other inputs or outputs.
        """
        if other := self.differences(spec, options):
            remedy = "resume with the settings it began with" if resume else "begin with another model, or with nothing"
            raise NeuralocksError(f"{self.path}: differs from this training in {', '.join(other)}; {remedy}")

    def differences(self, spec: BoundarySpec, options) -> list[str]:
        """How the kind of the model's network differs from a training's.

        Args:
            spec: what the training's network reads.
            options: of the training, with `output`, `motion`, `strand_map`, `static` and `anchored`.
        """
        deep = self._graphs["frame.onnx"].layers
        has = {name: self._meta.get(name) for name in ("output", "anchored", "static")}
        with about(self.path):
            read = BoundarySpec.from_json(self._meta.get("boundary"))
        has["boundary"] = spec if _reads_all_of(read, spec) else read
        has["motion"] = "modulated" if "deep" in deep else "encoder" if "bent" in deep else "linear"
        if "bent" in self._graphs["strand.onnx"].layers:  # a deep map can be added to a linear one, not taken away
            has["strand_map"] = "deep"
        wanted = {name: spec if name == "boundary" else getattr(options, name) for name in has}
        return [name for name, value in wanted.items() if has[name] != value]

    def coder(self) -> StrandAutoencoder:
        """The strand encoder, frozen. Its decoder has arbitrary weights, since model files have none."""
        layers = dict(self._graphs["encoder.onnx"].layers)
        flat = layers.pop("flat", None)
        coder = StrandAutoencoder(principal=flat is not None)
        with self._fits():
            for layer, (weight, bias) in zip(coder.encoder[::2], layers.values(), strict=True):
                _fill(layer, weight, bias)
            if flat is not None:  # its bias, from the mean, has no place of its own without a mean
                _fill(coder.into, flat[0])
                coder.encoder[-1].bias += torch.from_numpy(flat[1])
        return coder.eval().requires_grad_(False)

    def fill(self, net: StrandNet) -> None:
        """Make `net`, already normalised, give the model's outputs, as if the part of the history that only the model reads were
        empty; what only `net` reads or has changes no output at first. Inputs that the normalisation left out because they did not
        vary are read again: the model has learned from motion in which they did.
        """
        frame, tail = self._graphs["frame.onnx"], self._graphs["tail.onnx"].constants
        layers = dict(frame.layers)
        with self._fits():
            constant = self._fill_strand(net)
            reading = "frame_part" if net.encoder is None else "flat"
            for name in [reading, *[n for n in layers if n != reading][:1]]:
                # The oldest of the history comes last.
                layers[name] = (layers[name][0][: len(net.frame_scale)], layers[name][1])
            linear = layers.pop(reading)
            _read_again(net.frame_scale, linear, *list(layers.values())[:1])
            net.frame.bias.copy_(constant + _unfold(net.frame, *linear, net.frame_mean, net.frame_scale))
            if net.encoder is not None:
                _fill_deep(net.encoder, layers, net.frame_mean, net.frame_scale)
            for name, layer in (("middle", net.middle), ("out", net.out)):
                back = self._before_smoothing() if name == "out" else np.eye(layer.out_features)
                if net.motion != "modulated":
                    _fill(layer, tail[name] @ back, tail[f"{name}.bias"] @ back)
                    continue
                _fill(layer, frame.constants[f"{name}.plain"] @ back, tail[f"{name}.bias"] @ back)
                change = getattr(net, f"{name}_change")
                _fill(change.to_terms, frame.constants[f"{name}.to_terms"])
                _fill(change.back, frame.constants[f"{name}.back"] @ back)

    def _fill_strand(self, net: StrandNet) -> Tensor:
        """The strand's part of the first layer; returns the bias (HIDDEN,) that belongs to it."""
        layers = dict(self._graphs["strand.onnx"].layers)
        linear = layers.pop("flat" if "flat" in layers else "strand_part")
        unread = np.zeros((len(net.strand_scale) - len(linear[0]), len(linear[1])), np.float32)
        linear = np.concatenate([linear[0], unread]), linear[1]
        _read_again(net.strand_scale, linear, *list(layers.values())[:1])
        if net.strand_encoder is None:
            if layers:
                raise ValueError("a deep map of a strand")
        elif layers:
            _fill_deep(net.strand_encoder, layers, net.strand_mean, net.strand_scale)
        else:
            net.strand_encoder[-1].weight.zero_()
        return _unfold(net.strand, *linear, net.strand_mean, net.strand_scale)

    def _before_smoothing(self) -> np.ndarray:
        """(72, 72), multiplied from the right: undoes the smoothing that is folded into a model's last layer."""
        along = np.linalg.inv(smoothing()) if self._meta["output"] == "direction" else np.eye(K)
        return np.kron(along.T, np.eye(3))

    @contextmanager
    def _fits(self) -> Iterator[None]:
        try:
            with torch.no_grad():
                yield
        except (KeyError, ValueError, RuntimeError) as error:
            raise NeuralocksError(
                f"{self.path}: its network is built differently from this one ({fact_of(error)}); begin with another"
            ) from None


def kept_coder(work: Path) -> StrandAutoencoder:
    """The encoder, frozen, of the training that left this work folder."""
    saved, coder = work / CODES, StrandAutoencoder()
    if not saved.exists():
        return Beginning(work / BEGINNING).coder()
    checkpoint.load(saved, {"coder": coder})
    return coder.eval().requires_grad_(False)


def _reads_all_of(spec: BoundarySpec, wanted: BoundarySpec) -> bool:
    """Whether a network with `spec` reads all that `wanted` has; it may fade differently and read older history."""
    newest = spec.bins[: len(wanted.bins)]
    return bool(newest) == bool(spec.bins) and replace(spec, bins=newest, taper=wanted.taper) == wanted


def _fill(layer: nn.Linear, weight: np.ndarray, bias: np.ndarray | None = None) -> None:
    """Fill a layer from the (in, out) weight and the (out,) bias of a graph."""
    layer.weight.copy_(_tensor(weight, layer.weight.T.shape).T)
    if bias is not None:
        layer.bias.copy_(_tensor(bias, layer.bias.shape))


def _fill_deep(net: nn.Sequential, layers: dict, mean: Tensor, scale: Tensor) -> None:
    """Fill a deep map from the layers of a graph, the first of which reads inputs that are not normalised."""
    first, *others = zip(net[::2], layers.values(), strict=True)
    first[0].bias.copy_(_unfold(first[0], *first[1], mean, scale))
    for layer, (weight, bias) in others:
        _fill(layer, weight, bias)


def _read_again(scale: Tensor, *layers: tuple[np.ndarray, np.ndarray]) -> None:
    """Read inputs again that the model's layers weigh but a normalisation left out."""
    weighed = np.any([(weight != 0).any(axis=1) for weight, _ in layers], axis=0)
    scale[(scale == 0) & _tensor(weighed, scale.shape)] = 1.0


def _unfold(layer: nn.Linear, weight: np.ndarray, bias: np.ndarray, mean: Tensor, scale: Tensor) -> Tensor:
    """Give a layer that reads (x - mean) * scale the weight of one that reads x; returns the bias that makes both equal."""
    weight, bias = _tensor(weight, layer.weight.T.shape).double(), _tensor(bias, layer.weight.shape[:1]).double()
    layer.weight.copy_((weight / torch.where(scale > 0, scale, 1.0).double()[:, None]).T)
    return (bias + mean.double() @ weight).float()


def _tensor(array: np.ndarray, shape) -> Tensor:
    if array.shape != tuple(shape) or not np.isfinite(array).all():
        raise ValueError(f"{array.shape} numbers where {tuple(shape)} belong")
    return torch.from_numpy(array)
