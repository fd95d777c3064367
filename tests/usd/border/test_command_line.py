# SPDX-License-Identifier: Apache-2.0
"""A model's card has the command that trained it."""

import pytest

from usd.border.command_line import command_line


@pytest.mark.parametrize("program", ("/usr/bin/neuralocks", "C:/x/neuralocks.exe", "/home/me/usd/__main__.py"))
def test_the_card_has_the_command_however_it_is_begun(program, monkeypatch):
    monkeypatch.setattr("sys.argv", [program, "train", "-o", "a b.neuralocks"])
    assert command_line() == "neuralocks train -o 'a b.neuralocks'"
    monkeypatch.setattr("sys.argv", ["/home/me/my_script.py", "train"])
    assert command_line() == ""
