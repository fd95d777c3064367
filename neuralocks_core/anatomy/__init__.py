# SPDX-License-Identifier: Apache-2.0
"""Which joint is which: the humanoid names of a skeleton, by name and by shape, and how it stands."""
