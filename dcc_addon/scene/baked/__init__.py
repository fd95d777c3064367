# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked caches on hair objects, and what each was made of."""
