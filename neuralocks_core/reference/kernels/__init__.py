# SPDX-License-Identifier: Apache-2.0
"""What warp compiles for the solvers."""
