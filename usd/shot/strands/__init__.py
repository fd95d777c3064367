# SPDX-License-Identifier: Apache-2.0
"""The curves of hair: their points, and between which of them they are drawn."""
