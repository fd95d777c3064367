# SPDX-License-Identifier: Apache-2.0
"""Slow and trusted: the rod solver that results are compared with. Needs warp (extra `compare`)."""

from neuralocks_core.reference.rods import Rollout, simulate

__all__ = ["Rollout", "simulate"]
