# SPDX-License-Identifier: Apache-2.0
"""Training in torch: networks, losses, loops and the way into a model file. Nothing that runs a bake imports this."""
