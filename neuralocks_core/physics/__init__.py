# SPDX-License-Identifier: Apache-2.0
"""Rod geometry and the potentials of the paper in torch, one per file. Nothing that a bake runs imports this."""
