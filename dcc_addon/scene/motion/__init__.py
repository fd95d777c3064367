# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's motion: what makes it up, sampling it, and whether a sampling is up to date."""
