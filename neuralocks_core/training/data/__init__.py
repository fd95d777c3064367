# SPDX-License-Identifier: Apache-2.0
"""What a network learns from: simulated rollouts, or moments of made-up motion."""
