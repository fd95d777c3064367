# SPDX-License-Identifier: Apache-2.0
"""Where USD's world becomes ours and back: units, axes, arrays, times, paths."""
