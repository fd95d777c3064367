# SPDX-License-Identifier: GPL-3.0-or-later
"""How files are named that the panel writes unasked."""

from dcc_addon.services.rigs.names import LONGEST, file_label
from dcc_addon.services.work.overwriting import untaken


def test_labels_keep_letters_of_all_scripts():
    assert [file_label(name) for name in ("前髪", "Hair.L", "Käthe 2")] == ["前髪", "Hair_L", "Käthe_2"]
    assert len(file_label("髪" * 200).encode()) <= LONGEST and set(file_label("髪" * 200)) == {"髪"}


def test_what_is_taken_gets_another_name(tmp_path):
    """The name itself if it is free, otherwise with a label and a number."""
    out, taken = tmp_path / "out.usdc", set()
    names = []
    for _ in range(4):
        found = untaken(out, "Bob", taken.__contains__)
        taken.add(found)
        names.append(found.relative_to(tmp_path).as_posix())
    assert names == ["out.usdc", "out_Bob.usdc", "out_Bob_2.usdc", "out_Bob_3.usdc"]
