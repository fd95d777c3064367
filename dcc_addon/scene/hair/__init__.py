# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair objects: their curves, node trees and modifiers."""
