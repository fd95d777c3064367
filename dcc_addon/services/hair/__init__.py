# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair at any time of a sampled motion."""
