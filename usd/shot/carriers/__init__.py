# SPDX-License-Identifier: Apache-2.0
"""What carries a groom, and where it lies in the bind pose of that."""
