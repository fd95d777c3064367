# SPDX-License-Identifier: Apache-2.0
"""Rod geometry and the potentials of the paper in torch, one a file. Nothing that runs a bake imports this."""
