# SPDX-License-Identifier: Apache-2.0
"""Model files: read, checked and run, and the graphs in them."""
