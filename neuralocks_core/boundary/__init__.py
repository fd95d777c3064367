# SPDX-License-Identifier: Apache-2.0
"""What a network reads of the body: its motion, made smooth, as one vector for each frame."""
