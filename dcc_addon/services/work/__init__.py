# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work, and the files that it leaves."""
