# SPDX-License-Identifier: Apache-2.0
"""The tiny network of a rig during training."""

from itertools import pairwise

import numpy as np
import torch

from neuralocks_core.rig.network import MAX_ANGLE, POSE, RigModel, held_features, input_limits
from neuralocks_core.training.rig.energy import bounded_turns
from neuralocks_core.training.rig.poses import PosePool


class TinyNet(torch.nn.Module):
    """Two hidden layers; gives turns (B, N, 4) wxyz in canonical axes, none for the held bind pose.

    Args:
        hidden: width of both layers.
        pool: poses of the rig, with N hair joints, whose features scale the inputs.
        spec: which features these are, F of them.
    """

    def __init__(self, hidden: int, pool: PosePool, spec):
        super().__init__()
        self.hidden, self.joints, self.spec = hidden, len(pool.rig.chains), spec
        sample = np.arange(min(pool.count, 512))
        features = pool.situations(spec, sample)
        self.register_buffer("mean", torch.as_tensor(features.mean(0)))
        self.register_buffer("scale", torch.as_tensor(1 / np.maximum(features.std(0), 0.05)))
        still = held_features(spec, np.tile(np.eye(3), (1, 2, 1, 1)), np.array([[0.0, -1.0, 0.0]]))
        self.register_buffer("bind", torch.as_tensor(still))
        self.layers = torch.nn.ModuleList(
            [torch.nn.Linear(a, b) for a, b in pairwise((still.shape[1], hidden, hidden, 3 * self.joints))]
        )
        torch.nn.init.normal_(self.layers[2].weight, std=0.02)

    def normalise(self, features: np.ndarray) -> None:
        """Scale the inputs of a dynamic network by a sample (n, F) of motion."""
        self.mean.copy_(torch.as_tensor(features.mean(0)))
        deviation = np.maximum(features.std(0), 0.02)
        deviation[POSE:] *= 3.0  # so that the long history does not drown the pose
        self.scale.copy_(torch.as_tensor(1 / deviation))
        self.mean[POSE:] = 0

    def begin_as(self, model: RigModel) -> None:
        """Take over the weights of a model of as many joints, as wide and with the same inputs; call `normalise` first."""
        axes = model.chains.axes
        w, b = zip(*((weight.astype(float), bias.astype(float)) for weight, bias in model.layers))
        turned = np.einsum("nij,njk->nik", axes, w[2].reshape(-1, 3, w[2].shape[1])).reshape(w[2].shape)
        mean, scale = self.mean.double().numpy(), self.scale.double().numpy()
        # The last biases only cancel the answer to the bind pose, which is subtracted here.
        values = ((w[0] / scale, b[0] + w[0] @ mean), (w[1], b[1]), (turned, 0 * b[2]))
        with torch.no_grad():
            for layer, (weight, bias) in zip(self.layers, values, strict=True):
                layer.weight.copy_(torch.as_tensor(weight))
                layer.bias.copy_(torch.as_tensor(bias))

    def raw(self, features: torch.Tensor) -> torch.Tensor:
        """Unbounded outputs (B, 3 N) of features (B, F)."""
        value = (features - self.mean) * self.scale
        value = torch.relu(self.layers[0](value))
        return self.layers[2](torch.relu(self.layers[1](value)))

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        raw = self.raw(features) - self.raw(self.bind)
        return bounded_turns(raw.reshape(len(features), self.joints, 3), MAX_ANGLE)

    def model(self, chains, training: dict) -> RigModel:
        """The model that runs without torch, for the chains that this was trained on."""
        limits = input_limits(self.spec)
        return RigModel(chains, self.spec, self.plain_layers(chains.axes), limits, training=training)

    def plain_layers(self, axes: np.ndarray) -> tuple:
        """Weights and biases with the normalisation, the bind pose and the joints' axes (N, 3, 3) folded in;
        summed in float64.
        """
        w = [layer.weight.detach().double().numpy() for layer in self.layers]
        b = [layer.bias.detach().double().numpy() for layer in self.layers]
        b[0] = b[0] - w[0] @ (self.mean * self.scale).double().numpy()
        w[0] = w[0] * self.scale.double().numpy()
        w, b = [x.astype(np.float32) for x in w], [x.astype(np.float32) for x in b]
        hidden = np.maximum(w[0] @ self.bind[0].numpy() + b[0], 0)
        hidden = np.maximum(w[1] @ hidden + b[1], 0).astype(float)
        turned = np.einsum("nji,njk->nik", axes, w[2].astype(float).reshape(-1, 3, w[2].shape[1]))
        w[2] = turned.reshape(w[2].shape).astype(np.float32)
        b[2] = -(w[2].astype(float) @ hidden)
        return tuple(zip(w, b))
