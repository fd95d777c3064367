# SPDX-License-Identifier: Apache-2.0
"""Which curves of a stage are hair."""
