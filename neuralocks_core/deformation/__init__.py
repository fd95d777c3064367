# SPDX-License-Identifier: Apache-2.0
"""A frame of hair: the network bound to a groom, clumped, kept out of the body, carried to the groom's own vertices."""
