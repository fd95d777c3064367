# SPDX-License-Identifier: GPL-3.0-or-later
"""The frame that is shown, and what windows, view layers and renders draw of it."""
