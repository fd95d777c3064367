# SPDX-License-Identifier: Apache-2.0
"""The border to USD, in both directions: units, axes, arrays, times, paths."""
