# SPDX-License-Identifier: GPL-3.0-or-later
"""Modifiers of hair that the live view, or a cache, already moves: those that would move it a second time are off meanwhile, in
all frames, and those that grow more hair beside it use the posed surface. Their settings are stored with the hair, and restored.
"""

import json

from ..objects.stored_values import remembered
from . import blur, switches, unbound
from .nodes import inputs_of, read_input, write_input

CACHE = "Neuralocks Cache"
"""The modifier that plays a bake of this add-on."""
SIMULATION, DEFORM = "GeometryNodeXPBDSolver", "GeometryNodeDeformCurvesOnSurface"
"""Nodes at the heart of the modifiers that Blender puts on new hair: since 5.2 Hair Dynamics, before that Surface Deform."""
PLAIN = {DEFORM, "NodeGroupInput", "NodeGroupOutput", "NodeReroute", "NodeFrame"}
"""Nodes of a tree that only lets hair follow its surface."""
RESTING = {"Surface Rest Position", "Resting Surface"}
"""Inputs of Blender's hair assets that make them use the surface at rest, because what deforms it comes later in the stack: their
names up to 5.1, and since.
"""


def mute_deformers(hair, kept: str = "muted") -> None:
    """Switch off, and remember in the setting `kept`, what makes the hair follow the surface, simulates it, or uses the surface at
    rest: hair from the live view or a cache is already posed.
    """
    settings = hair.neuralocks_hair
    text = getattr(settings, kept)
    found, deforms = remembered(text, _fits), False
    for modifier in hair.modifiers:
        shown, before = modifier.show_viewport or modifier.show_render, found.get(modifier.name, ())
        hidden = any(isinstance(value, bool) for value in before)  # otherwise its inputs are remembered, if anything is
        if _moves(modifier, hair):
            switched = switches.mute(modifier)
            if (shown or switched) and not hidden:
                found[modifier.name] = _before(hair, modifier, found)
            if switched:
                places, more = found[modifier.name][:2], found[modifier.name][2:]
                found[modifier.name] = [*places, *sorted({*more, *switched})]
            if shown:
                modifier.show_viewport = modifier.show_render = False
            continue
        deforms = deforms or (shown and _has(_tree(modifier), {DEFORM}))
        if not hidden and (on := [name for name in _resting(modifier) if read_input(modifier, name)]):
            found[modifier.name] = sorted({*on, *before})
            _write(hair, modifier, on, False)
    if deforms:
        unbound.unbind(hair.data, kept)
    if found and (now := json.dumps(found)) != text:
        setattr(settings, kept, now)


def unmute_deformers(hair, kept: str = "muted") -> None:
    """Switch them on again as they were."""
    settings = hair.neuralocks_hair
    if hair.type == "CURVES":  # otherwise it was converted
        unbound.bind(hair.data, kept)
    if not getattr(settings, kept):  # writing it would be an update of the hair, which may call this again
        return
    found = remembered(getattr(settings, kept), _fits)
    off, resting = iter(_renamed(hair, found)), iter(_renamed_resting(hair, found))
    for name, before in found.items():
        inputs = isinstance(before[0], str)
        modifier = hair.modifiers.get(name) or next(resting if inputs else off, None)
        if modifier is None:
            continue
        if inputs:
            _write(hair, modifier, [name for name in _resting(modifier) if name in before], True)
        else:
            modifier.show_viewport, modifier.show_render, *switched = before
            switches.unmute(modifier, switched)
    setattr(settings, kept, "")


def off_meanwhile(hair) -> list[str]:
    """Names of the modifiers that are switched off as a whole while the hair is live, or plays a cache."""
    own = hair.neuralocks_hair
    found = [
        name
        for kept in (own.muted, own.replaced)
        for name, before in remembered(kept, _fits).items()
        if isinstance(before[0], bool) and any(before)
    ]
    return [name for name in dict.fromkeys(found) if name in hair.modifiers]


def caches_of_others(thing) -> list:
    """Modifiers that play a cache which is not of this add-on: an importer makes the shape of one of its frames the shape of the object."""
    return [m for m in thing.modifiers if m.type == "MESH_SEQUENCE_CACHE" and m.name != CACHE]


def on_top(hair) -> list[str]:
    """Names of the modifiers that do more than move the hair, and are not switched off: a cache plays below them."""
    shown = [m for m in hair.modifiers if m.show_viewport or m.show_render]
    return [m.name for m in shown if m.name != blur.CACHED and not _only_moves(m)]


def _fits(values: list) -> bool:
    """Whether these values can be a modifier's: where it was shown, and which of `switches.KINDS` played; or which of its inputs
    were on.
    """
    shown = len(values) >= 2 and all(isinstance(value, bool) for value in values[:2])
    shown = shown and all(value in switches.KINDS for value in values[2:])
    return shown or (bool(values) and all(isinstance(value, str) for value in values))


def _before(hair, modifier, found: dict) -> list[bool]:
    """What is stored of a modifier that is not among those remembered: as it is shown now; or, if it is one of them that was renamed and
    then switched on by hand in one place, as that one was.
    """
    gone = [name for name, before in found.items() if name not in hair.modifiers and isinstance(before[0], bool)]
    if modifier.show_viewport != modifier.show_render and len(gone) > len(_renamed(hair, found)):
        return found.pop(gone[-1])
    return [modifier.show_viewport, modifier.show_render]


def _renamed(hair, found: dict) -> list:
    """Modifiers that are off and not among those remembered by name."""
    off = [m for m in hair.modifiers if not (m.show_viewport or m.show_render or m.name in found)]
    return [m for m in off if m.type == "MESH_SEQUENCE_CACHE" or _has(_tree(m), {SIMULATION, DEFORM})]


def _renamed_resting(hair, found: dict) -> list:
    """Modifiers that could take the surface at rest, do not, and are not among those remembered by name."""
    inputs = [(m, _resting(m)) for m in hair.modifiers if m.name not in found]
    return [m for m, names in inputs if names and not any(read_input(m, name) for name in names)]


def _write(hair, modifier, names, value: bool) -> None:
    for name in names:
        write_input(modifier, name, value)
    hair.update_tag()


def _moves(modifier, hair) -> bool:
    """Whether all that a modifier does to the hair has been done already."""
    return _only_moves(modifier) or (_has(_tree(modifier), {DEFORM}) and not unbound.possible(hair.data))


def _only_moves(modifier) -> bool:
    """Whether a modifier moves the hair, and does nothing else."""
    tree = _tree(modifier)
    if modifier.type == "MESH_SEQUENCE_CACHE" or _has(tree, {SIMULATION}):
        return True
    return _has(tree, {DEFORM}) and all(node.bl_idname in PLAIN for node in tree.nodes)


def _tree(modifier):
    return modifier.node_group if modifier.type == "NODES" else None


def _resting(modifier) -> list[str]:
    """Identifiers of the inputs that make a modifier use the surface at rest."""
    return [identifier for name, identifier in inputs_of(_tree(modifier)) if name in RESTING]


def _has(tree, kinds: set[str], depth: int = 0) -> bool:
    """Whether a tree, or a group in it, has a node of one of these kinds."""
    if tree is None or depth > 8:
        return False
    for node in tree.nodes:
        if node.bl_idname in kinds:
            return True
        if node.bl_idname == "GeometryNodeGroup" and _has(node.node_tree, kinds, depth + 1):
            return True
    return False
