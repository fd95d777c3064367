# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair: what Blender shows of strands and hair bones, in any frame."""
