# SPDX-License-Identifier: Apache-2.0
"""Notes on a shot: what its user should know before a bake."""
