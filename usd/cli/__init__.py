# SPDX-License-Identifier: Apache-2.0
"""The command line `neuralocks`: one module per family of commands."""
