# SPDX-License-Identifier: GPL-3.0-or-later
"""Armature and body as arrays, and what is bound to them."""
