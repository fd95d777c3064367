# SPDX-License-Identifier: Apache-2.0
"""Files that are not USD: grooms of other tools, and motion."""

from neuralocks_core.formats.reading import EXTENSIONS, common_unit, read, read_with_look, read_with_notes

__all__ = ["EXTENSIONS", "common_unit", "read", "read_with_look", "read_with_notes"]
