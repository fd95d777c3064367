# SPDX-License-Identifier: Apache-2.0
"""Training of rigged mesh hair: the energy of its chains, poses and bodies to learn from, reports."""
