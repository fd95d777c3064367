# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers and keys that show or hide a modifier: they would switch on a modifier that is off meanwhile, so they are muted."""

from ...session import session
from ..objects.animated import curves_of, is_muted, strips_of

KINDS = tuple(f"{kind} of {place}" for kind in ("driver", "keys") for place in ("show_viewport", "show_render"))
"""What may switch a modifier, as it is stored."""


def mute(modifier) -> list[str]:
    """Mute what plays; returns which of KINDS that is."""
    playing = [(kind, curve) for kind, curve in _curves(modifier) if not is_muted(curve)]
    _set(modifier, [curve for _, curve in playing], True)
    return sorted({kind for kind, _ in playing})


def unmute(modifier, kinds) -> None:
    """Let these of KINDS play again."""
    _set(modifier, [curve for kind, curve in _curves(modifier) if kind in kinds and curve.mute], False)


def _curves(modifier) -> list:
    """Each F-curve that switches a modifier, after its kind."""
    kinds = {modifier.path_from_id(kind.split()[-1]): kind.split()[-1] for kind in KINDS}
    found = [curve for curve in curves_of(modifier.id_data.animation_data) if curve.data_path in kinds]
    return [(f"{'driver' if c.driver is not None else 'keys'} of {kinds[c.data_path]}", c) for c in found]


def _set(modifier, curves: list, value: bool) -> None:
    for curve in curves:
        curve.mute = value
    if curves:  # Blender reports that as edits of all that animates the hair
        data = modifier.id_data.animation_data
        session.switched |= {user.action.name_full for user in (data, *strips_of(data)) if user.action is not None}
