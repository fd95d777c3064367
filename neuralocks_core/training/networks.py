# SPDX-License-Identifier: Apache-2.0
"""The strand simulator network: two hidden layers, its first layer split into a strand part and a frame part."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from neuralocks_core.models.network_sizes import CODE, HIDDEN, PLAIN_STRAND, SHAPE, STRAND, K
from neuralocks_core.strands.strand_set import CLAMPED

OUTPUTS = ("direction", "displacement")
MOTIONS = ("linear", "encoder", "modulated")
STRAND_MAPS = ("linear", "deep")
LIMITED = (slice(2, 2 + 2 * CODE), slice(PLAIN_STRAND, STRAND))
"""Positions of the strand's code, its lock's code and its rest points among the strand inputs."""
DEEP = 192
"""Width of the deep map of the frame."""
DEEP_STRAND = 128
"""Width of the deep map of a strand."""
RANKS = (64, 32)
"""Ranks of the matrices that a frame adds to the second layer's and to the output layer's."""
HISTORY_SCALE = 0.25
"""Factor on the many history entries after normalisation; without it they would drown the pose."""


def smoothing() -> np.ndarray:
    """(K, K) means of each vertex's offset and its neighbours' along the strand, a half and two quarters; clamped ones stay.

    An uncertain network outputs the mean of what is possible, which is shorter than any hair. Hair that keeps its length can
    only be that short by zigzagging from edge to edge, which no such mean does.
    """
    matrix = np.eye(K)
    for i in range(CLAMPED, K):
        matrix[i, i] = 0.5
        for j in (max(i - 1, CLAMPED), min(i + 1, K - 1)):
            matrix[i, j] += 0.25
    return matrix


_SMOOTHING = torch.from_numpy(smoothing()).float()


class StrandNet(nn.Module):
    """Maps a strand and the body's motion to offsets of 24 vertices (paper section 3.3, figure 2).

    The first layer is one linear map of the whole input, written as a sum of two: the strand part is constant for a
    groom, the frame part for a frame, so a bake computes each once. Its inputs from a strand are
    `strand_session.strand_inputs`. Inputs are SI; normalisation is stored in buffers and folded into the weights at export.

    Args:
        frame_size: length of the boundary vector, `BoundarySpec.size`.
        motion: `"linear"`, as in the paper; `"encoder"`: a deeper map of the boundary vector is added to the linear
            one; `"modulated"`: that map also scales the units of both hidden layers and adds matrices of low rank to
            the weights that follow them. The map and these changes are computed once per frame: nothing is added
            per strand.
        strand_map: `"linear"`, as in the paper; `"deep"`: a deeper map of the strand inputs is added to the linear one. It runs
            once per groom: a strand's direction is not linear in its code, which is in the scalp's axes.
    """

    def __init__(self, frame_size: int, *, motion: str = "linear", strand_map: str = "linear"):
        super().__init__()
        for name, value, known in (("motion", motion, MOTIONS), ("strand_map", strand_map, STRAND_MAPS)):
            if value not in known:
                raise ValueError(f"{name}: {value!r} is not one of {known}")
        self.motion = motion
        self.strand = nn.Linear(STRAND, HIDDEN, bias=False)
        self.frame = nn.Linear(frame_size, HIDDEN)
        # Both halves start like slices of one Linear over the whole input.
        bound = (STRAND + frame_size) ** -0.5
        for parameter in (self.strand.weight, self.frame.weight, self.frame.bias):
            nn.init.uniform_(parameter, -bound, bound)
        self.strand_encoder = _deep(STRAND, DEEP_STRAND, 2, HIDDEN) if strand_map == "deep" else None
        self.encoder = None
        if motion != "linear":
            self.encoder = _deep(frame_size, DEEP, 3, 3 * HIDDEN + sum(RANKS) if motion == "modulated" else HIDDEN)
        self.middle = nn.Linear(HIDDEN, HIDDEN)
        self.out = nn.Linear(HIDDEN, SHAPE)
        if motion == "modulated":
            self.middle_change = LowRank(HIDDEN, RANKS[0], HIDDEN)
            self.out_change = LowRank(HIDDEN, RANKS[1], SHAPE)
        with torch.no_grad():
            # Hair starts at rest: zero offsets are both the groom and a direction that exists.
            self.out.weight.mul_(0.1)
            self.out.bias.zero_()
            if strand_map == "deep":
                self.strand_encoder[-1].weight.mul_(0.02)
                self.strand_encoder[-1].bias.zero_()
            if motion == "modulated":
                self.encoder[-1].weight.mul_(0.1)
                self.encoder[-1].bias.zero_()
                self.middle_change.back.weight.mul_(0.3)
                self.out_change.back.weight.mul_(0.1)
        for name, size in (("strand", STRAND), ("frame", frame_size)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_scale", torch.ones(size))

    @torch.no_grad()
    def set_normalisation(self, strands: Tensor, frames: Tensor, history: slice, *, static: bool = False) -> None:
        """Take mean and standard deviation of the inputs from training samples.

        Args:
            strands: (n, 142) sampled strand inputs.
            frames: (m, frame_size) sampled boundary vectors.
            history: where the velocity history lies in the boundary vector.
            static: the quasi-static variant: the history is not read at all.
        """
        for name, samples in (("strand", strands), ("frame", frames)):
            samples = samples.to(torch.float64)
            mean, std = samples.mean(0), samples.std(0, unbiased=False)
            # An input that never varied was never learned: reading it later could only add noise.
            floor = 1e-5 * (1.0 + mean.abs())
            scale = torch.where(std > floor, 1.0 / std.clamp_min(1e-12), torch.zeros_like(std))
            if name == "strand":
                # A code's last components tell hairs of one groom apart, and so do small offsets between a mohawk's hairs;
                # scaled up to the size of the first, they would put a groom that was not trained on far outside.
                for part in LIMITED:
                    scale[part] = scale[part].clamp_max(50.0 / float(std[part].max().clamp_min(1e-9)))
            if name == "frame":
                mean[history] = 0.0  # a held pose is exactly zero here and stays so
                rms = samples[:, history].square().mean(0).sqrt()
                live = torch.where(rms > 1e-6, HISTORY_SCALE / rms.clamp_min(1e-12), torch.zeros_like(rms))
                scale[history] = 0.0 if static else live
            getattr(self, f"{name}_mean").copy_(mean)
            getattr(self, f"{name}_scale").copy_(scale)

    def strand_part(self, strands: Tensor) -> Tensor:
        """First layer, strand part: (..., S, 142) -> (..., S, 256)."""
        normal = (strands - self.strand_mean) * self.strand_scale
        part = self.strand(normal)
        return part if self.strand_encoder is None else part + self.strand_encoder(normal)

    def frame_part(self, frames: Tensor) -> Tensor:
        """First layer, body part and bias: (..., frame_size) -> (..., HIDDEN), or (..., 3 HIDDEN + sum(RANKS)) with the
        factors of both hidden layers and of the low-rank matrices that follow them.
        """
        normal = (frames - self.frame_mean) * self.frame_scale
        part = self.frame(normal)
        if self.encoder is None:
            return part
        deep = self.encoder(normal)
        # Factors have no linear part: they are one plus the deep map's output.
        return deep + nn.functional.pad(part, (0, deep.shape[-1] - part.shape[-1]), value=1.0)

    def tail(self, strand_part: Tensor, frame_part: Tensor) -> Tensor:
        """The work per strand and frame: broadcastable first-layer parts -> (..., S, outputs)."""
        hidden = strand_part.shape[-1]
        if self.motion != "modulated":
            return self.out(torch.relu(self.middle(torch.relu(strand_part + frame_part))))
        added, one, two, middle, out = frame_part.split([hidden, hidden, hidden, *RANKS], dim=-1)
        first = torch.relu(strand_part + added) * one
        second = torch.relu(self.middle(first) + self.middle_change(first, middle)) * two
        return self.out(second) + self.out_change(second, out)


def _deep(inputs: int, width: int, layers: int, outputs: int) -> nn.Sequential:
    """This many hidden layers, each followed by ReLU, and a linear one."""
    sizes = [inputs, *[width] * layers]
    hidden = [part for pair in zip(sizes, sizes[1:]) for part in (nn.Linear(*pair), nn.ReLU())]
    return nn.Sequential(*hidden, nn.Linear(width, outputs))


class LowRank(nn.Module):
    """A low-rank matrix (outputs, inputs) whose terms a frame weights: x -> back(weights * to(x))."""

    def __init__(self, inputs: int, rank: int, outputs: int):
        super().__init__()
        self.to_terms = nn.Linear(inputs, rank, bias=False)
        self.back = nn.Linear(rank, outputs, bias=False)

    def forward(self, x: Tensor, weights: Tensor) -> Tensor:
        """(..., inputs), (..., rank) -> (..., outputs)."""
        return self.back(self.to_terms(x) * weights)


def deform(offsets: Tensor, rest: Tensor, anchored_offsets: Tensor | None = None, output: str = "direction") -> Tensor:
    """Displacement of the vertices for the network's offsets.

    `"direction"`: edge i-1 -> i points along `normalise(e_rest + o_i)`, o smoothed along the strand, and keeps its length, so
    stretch cannot happen and hair may turn far without an energy barrier. `"displacement"` is the paper's choice, `x = x_rest + o`.
    The first CLAMPED vertices, 0 and 1, stay in both; zero offsets give exactly zero.

    Args:
        offsets: (..., S, 24, 3) network output.
        rest: (S, 24, 3), or broadcastable to the offsets; canonical space, metres.
        anchored_offsets: the network's output for the held bind pose, subtracted so that this pose gives the groom itself.
        output: `"direction"` or `"displacement"`.

    Returns:
        (..., S, 24, 3) displacement from rest, metres, canonical space.

    Raises:
        ValueError: `output` is neither of the two.
    """
    if anchored_offsets is not None:
        offsets = offsets - anchored_offsets
    if output == "displacement":
        clamped = torch.zeros_like(offsets[..., :CLAMPED, :])
        return torch.cat([clamped, offsets[..., CLAMPED:, :]], dim=-2)
    if output != "direction":
        raise ValueError(f"output: {output!r} is not one of {OUTPUTS}")
    offsets = _SMOOTHING.to(offsets) @ offsets
    edges = rest[..., 1:, :] - rest[..., :-1, :]
    lengths = edges.square().sum(-1, keepdim=True).sqrt()
    turned = edges[..., 1:, :] + lengths[..., 1:, :] * offsets[..., CLAMPED:, :]
    # The tiny number keeps zero-length edges, and offsets that cancel an edge, finite in value and gradient.
    norm = turned.square().sum(-1, keepdim=True).clamp_min(1e-18).sqrt()
    change = turned * (lengths[..., 1:, :] / norm) - edges[..., 1:, :]
    moved = torch.cumsum(change, dim=-2)
    return torch.cat([torch.zeros_like(moved[..., :CLAMPED, :]), moved], dim=-2)
