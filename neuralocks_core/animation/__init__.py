# SPDX-License-Identifier: Apache-2.0
"""Making and analysing clips: retargeted captures, random motion, cuts."""
