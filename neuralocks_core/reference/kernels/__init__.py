# SPDX-License-Identifier: Apache-2.0
"""Warp kernels of the solvers."""
