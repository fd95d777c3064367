# SPDX-License-Identifier: GPL-3.0-or-later
"""Cache files that were written again. Blender's USD library holds a file in memory, and reads it again only after everything that
plays it has let go of it: otherwise, hair would go on playing the earlier bake.
"""

import bpy


def read_again(caches) -> None:
    """Read the files of these data blocks again, in all view layers and renders."""
    for scene in bpy.data.scenes:
        if scene.render.use_persistent_data:  # with it, a render keeps what it has read
            scene.render.use_persistent_data = False
            scene.render.use_persistent_data = True
    layers = {layer for scene in bpy.data.scenes for layer in scene.view_layers if layer.depsgraph is not None}
    if len(caches) == 1:  # the view layer in view lets go of one, but not of all at once
        layers.discard(bpy.context.view_layer)
    named = [(cache, cache.filepath) for cache in caches] if layers else []
    for cache, _ in named:
        cache.filepath = ""
    for layer in layers:
        layer.depsgraph.update()
    for cache, path in named:
        cache.filepath = path
    for cache in caches:
        with bpy.context.temp_override(edit_cachefile=cache):
            bpy.ops.cachefile.reload()
