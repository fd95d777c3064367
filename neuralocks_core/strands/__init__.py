# SPDX-License-Identifier: Apache-2.0
"""A groom as the network sees it: 24 vertices per strand, scalp frames, locks."""
