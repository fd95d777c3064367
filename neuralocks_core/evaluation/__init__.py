# SPDX-License-Identifier: Apache-2.0
"""What a bake is worth: the report card, energies, and the comparison with the solver."""
