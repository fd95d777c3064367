# SPDX-License-Identifier: Apache-2.0
"""What a bake says of itself, and what is missing in it."""
