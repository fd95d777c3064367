# SPDX-License-Identifier: Apache-2.0
"""The layer of a bake, and the data from which an interrupted one goes on."""
