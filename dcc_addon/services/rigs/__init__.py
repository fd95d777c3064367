# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig and its motion as arrays."""
