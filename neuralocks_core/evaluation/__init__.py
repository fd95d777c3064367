# SPDX-License-Identifier: Apache-2.0
"""How good a bake is: the report card, energies, and the comparison with the solver."""
