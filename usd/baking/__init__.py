# SPDX-License-Identifier: Apache-2.0
"""Baking strands: from a pose to time samples in an override layer."""
