# SPDX-License-Identifier: Apache-2.0
"""The points of a groom at a time code, in the prim's own space."""
