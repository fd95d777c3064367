# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframes on hair bones, and the bones' own rotations meanwhile."""
