# SPDX-License-Identifier: Apache-2.0
"""Strands for tests of the potentials, float64."""

import math

import torch


def rotation(angle=0.7):
    c, s = math.cos(angle), math.sin(angle)
    about_y = torch.tensor([[c, 0, s], [0, 1, 0], [-s, 0, c]], dtype=torch.float64)
    about_x = torch.tensor([[1, 0, 0], [0, c, -s], [0, s, c]], dtype=torch.float64)
    return about_x @ about_y


def straight(vertices=24, length=0.24, direction=(0.0, -1.0, 0.0)):
    along = torch.linspace(0, length, vertices, dtype=torch.float64)
    return (along[:, None] * torch.tensor(direction, dtype=torch.float64))[None]


def moved(curls, seed=1, amount=0.004):
    generator = torch.Generator().manual_seed(seed)
    return curls + amount * torch.randn(curls.shape, generator=generator, dtype=torch.float64)


def neighbours(strands=4, vertices=12):
    index = torch.arange(strands * vertices).reshape(strands, vertices)
    pairs = torch.stack([index.roll(1, 0), index.roll(-1, 0)], -1).to(torch.int32)
    pairs[:, 5, 1] = -1
    pairs[:, 0] = -1
    return pairs
