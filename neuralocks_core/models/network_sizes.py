# SPDX-License-Identifier: Apache-2.0
"""How many numbers the strand network takes and returns: the widths of a model file's graphs (docs/architecture.md)."""

K = 24
"""Vertices of a network strand, root first."""
SHAPE = 3 * K
"""Numbers of a strand's vertices or edges, and of the network's output."""
CODE = 32
"""Numbers that stand for a strand's rest shape."""
LOCK_CODES = slice(2 + CODE, 2 + 2 * CODE)
"""Where a strand's inputs have the code of its lock."""
PLAIN_STRAND = 2 + 2 * CODE + 3 + 1
"""Inputs of the paper's network for a strand: uv, its code and its lock's, root normal, length."""
STRAND = PLAIN_STRAND + SHAPE
"""Inputs of ours: these, and the strand's rest points."""
HIDDEN = 256
"""Width of both hidden layers."""
