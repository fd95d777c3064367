# SPDX-License-Identifier: Apache-2.0
"""The skeletons of a shot: which can be used, which belong to one person."""
