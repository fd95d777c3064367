# SPDX-License-Identifier: Apache-2.0
"""The methods of learning: what is minimised, and its options."""
