# SPDX-License-Identifier: Apache-2.0
"""Compiled code for what is slow in numpy: C without dependencies, one library a platform, and Python wherever none loads."""
