# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects by name, what animates them, and what a file keeps of them."""
