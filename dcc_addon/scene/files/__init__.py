# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and libraries as a Blender file names them, also after it was saved elsewhere or linked."""
