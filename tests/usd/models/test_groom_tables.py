# SPDX-License-Identifier: Apache-2.0
"""The files of a shot's grooms for other runtimes; what they hold is tested with the example that reads them."""

from usd.models.groom_tables import file_names


def test_no_disk_takes_two_grooms_files_for_one():
    paths = ["/World/Hair", "/World/hair", "/World_Hair", "/World_Hair_2", "/World/Brows"]
    assert file_names(paths)[::4] == ["World_Hair.npz", "World_Brows.npz"]
    assert len({name.lower() for name in file_names(paths)}) == len(paths)
