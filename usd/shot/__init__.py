# SPDX-License-Identifier: Apache-2.0
"""Reading a shot: which curves are hair, what carries them, and what is odd about that."""
