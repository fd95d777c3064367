# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists see: panels, their settings, and the add-on in menus and preferences."""
