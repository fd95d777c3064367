# SPDX-License-Identifier: Apache-2.0
"""Prims from arrays: grooms, bodies, animation, whole scenes."""
