# SPDX-License-Identifier: Apache-2.0
"""A groom as the network sees it: 24 vertices a strand, scalp frames, locks."""
