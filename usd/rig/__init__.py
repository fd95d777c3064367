# SPDX-License-Identifier: Apache-2.0
"""Rigged mesh hair in stages: reading, training, baking, drawing."""
