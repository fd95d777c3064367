# SPDX-License-Identifier: Apache-2.0
"""What errors of other libraries say fits in one line."""

import pytest

from neuralocks_core.errors import fact_of


@pytest.mark.parametrize(
    ("error", "fact"),
    [(ValueError("no graph\nat node 3"), "no graph"), (RuntimeError("\n  no graph"), "no graph")]
    + [(MemoryError(), "MemoryError"), (EOFError("\n"), "EOFError")],
)
def test_an_error_has_something_to_say(error, fact):
    assert fact_of(error) == fact
