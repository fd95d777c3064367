# SPDX-License-Identifier: Apache-2.0
"""A tiny VRM avatar as a binary glTF file: a head with two chains of hair of the same names, skin, glasses and a nod."""

import json
import struct

import numpy as np

FLOAT, SHORT = 5126, 5123
TRIANGLE = np.float32([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])


def avatar(path, seconds=1.0):
    """Write it; the head turns by 30 degrees in `seconds`."""
    nodes = [
        {"name": "Hips", "translation": [0, 1, 0], "children": [1]},
        {"name": "Head", "translation": [0, 0.5, 0], "children": [2, 4, 6]},
        {"name": "Hair 1", "translation": [0.1, 0, 0], "children": [3]},
        {"name": "Hair 2", "translation": [0, -0.1, 0]},
        {"name": "Hair 1", "translation": [-0.1, 0, 0], "children": [5]},
        {"name": "Hair 2", "translation": [0, -0.1, 0]},
        {"name": "Glasses", "translation": [0, 0, 0.1], "mesh": 1},
        {"name": "Skin", "mesh": 0, "skin": 0},
    ]
    places = {0: [0, 1, 0], 1: [0, 1.5, 0], 2: [0.1, 1.5, 0], 3: [0.1, 1.4, 0], 4: [-0.1, 1.5, 0], 5: [-0.1, 1.4, 0]}
    binds = np.tile(np.eye(4, dtype=np.float32), (6, 1, 1))
    binds[:, 3, :3] = [[-x for x in places[joint]] for joint in range(6)]  # in columns, as glTF stores them
    arrays = [
        ("VEC3", np.concatenate([TRIANGLE + np.float32(places[joint]) for joint in range(6)])),
        ("VEC4", np.repeat(np.uint16([[joint, 0, 0, 0] for joint in range(6)]), 3, axis=0)),
        ("VEC4", np.tile(np.float32([1, 0, 0, 0]), (18, 1))),
        ("MAT4", binds.reshape(6, 16)),
        ("VEC3", TRIANGLE),
        ("SCALAR", np.float32([0, seconds])),
        ("VEC4", np.float32([[0, 0, 0, 1], [np.sin(np.pi / 12), 0, 0, np.cos(np.pi / 12)]])),
    ]
    views, accessors, data = [], [], b""
    for view, (kind, array) in enumerate(arrays):
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        accessors.append(
            {
                "bufferView": view,
                "componentType": SHORT if array.dtype == np.uint16 else FLOAT,
                "count": len(array),
                "type": kind,
                "min": np.atleast_1d(array.min(axis=0)).tolist(),
                "max": np.atleast_1d(array.max(axis=0)).tolist(),
            }
        )
        data += array.tobytes()
    move = {
        "samplers": [{"input": 5, "output": 6}],
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}],
    }
    springs = [{"joints": [{"node": 2}, {"node": 3}]}, {"joints": [{"node": 4}, {"node": 5}]}]
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 7]}],
        "nodes": nodes,
        "meshes": [
            {"name": "Skin", "primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]},
            {"name": "Glasses", "primitives": [{"attributes": {"POSITION": 4}}]},
        ],
        "skins": [{"joints": list(range(6)), "inverseBindMatrices": 3}],
        "animations": [{"name": "Nod", **move}, {"name": "Nod more", **move}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
        "extensionsUsed": ["VRMC_vrm", "VRMC_springBone"],
        "extensions": {
            "VRMC_vrm": {"humanoid": {"humanBones": {"head": {"node": 1}}}},
            "VRMC_springBone": {"springs": springs},
        },
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    length = 28 + len(text) + len(data)
    parts = (
        struct.pack("<4sIII4s", b"glTF", 2, length, len(text), b"JSON"),
        text,
        struct.pack("<I4s", len(data), b"BIN\0"),
        data,
    )
    path.write_bytes(b"".join(parts))
    return path
