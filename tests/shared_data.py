# SPDX-License-Identifier: Apache-2.0
"""Grooms, captures and avatars of others, beside the repository where there are any."""

from pathlib import Path

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
