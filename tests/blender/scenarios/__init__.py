# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold inside a real Blender, one function a scenario; each begins with an empty scene and the add-on
enabled, and gets a folder for its files. Their modules need bpy, so they are listed without importing them.
"""

import ast
from pathlib import Path


def modules() -> dict[str, str]:
    """Module name by scenario: all public functions of the modules beside this one."""
    found = {}
    for path in sorted(Path(__file__).parent.glob("[!_]*.py")):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                assert node.name not in found, f"two scenarios are called {node.name}"
                found[node.name] = f"{__name__}.{path.stem}"
    return found
