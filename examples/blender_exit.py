# SPDX-License-Identifier: GPL-3.0-or-later
"""Ends a script that has imported bpy: some builds hang or crash when Python ends with a handler or a class still
registered, as after an error.
"""

import os
import sys
import traceback


def run_and_leave(main) -> None:
    """Call `main()`, then end this process at once: status 0, or 1 with a traceback if it raised."""
    status = 1
    try:
        main()
        status = 0
    except SystemExit:  # wrong usage, before anything is registered
        raise
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
