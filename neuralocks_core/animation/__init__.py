# SPDX-License-Identifier: Apache-2.0
"""Clips made and understood: retargeted captures, random motion, cuts."""
