# SPDX-License-Identifier: Apache-2.0
"""Neural hair: arrays in, arrays out. Knows no USD and no Blender."""
