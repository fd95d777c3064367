# SPDX-License-Identifier: Apache-2.0
"""Training in torch: networks, losses, loops and writing the model file. Nothing that a bake runs imports this."""
