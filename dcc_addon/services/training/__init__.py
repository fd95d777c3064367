# SPDX-License-Identifier: GPL-3.0-or-later
"""Training in a process of its own."""
