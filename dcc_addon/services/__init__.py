# SPDX-License-Identifier: GPL-3.0-or-later
"""All that the add-on does without Blender: arrays in, arrays out, tested without `bpy`."""
