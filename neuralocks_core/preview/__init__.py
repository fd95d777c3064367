# SPDX-License-Identifier: Apache-2.0
"""Pictures and clips of hair, without a display."""
