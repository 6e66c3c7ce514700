"""Say what of a compiled MJCF model is not read though MuJoCo computes with it, and where it stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..names import noted
from .compiling import Compiled
from .forces import split

#: Parts of dynamics that `<flag>` can disable; hybridyn takes them by `effects=` instead.
FLAGS = ("passive", "spring", "damper", "frictionloss", "limit", "actuation")


def note_on(compiled: Compiled, text: str, kind: str, numbers: Sequence[int]) -> list[str]:
    """Return the remark that concerns elements, at the place of the first; "{}" in it stands for their names.

    Args:
        kind: As in `Compiled.name`.
        numbers: Their numbers in the compiled model.
    """
    names = [compiled.label(kind, number) or str(number) for number in numbers]
    return [f"{compiled.at(kind, numbers[0])}: {one}" for one in noted({text: names})]


def unread_elements(compiled: Compiled, root: int) -> list[str]:
    """Return notes on elements that are not read though MuJoCo computes with them.

    Args:
        root: Number of the root body.
    """
    model = compiled.model
    balls, free = (model.jnt_type == compiled.code(word) for word in ("mjJNT_BALL", "mjJNT_FREE"))
    limited = model.tendon_limited | getattr(model, "tendon_actfrclimited", model.tendon_limited)
    found = {
        ("body", "mocap bodies are read as fixed: {}"): np.asarray(model.body_mocapid) >= 0,
        ("joint", "limits of balls {} are not read"): model.jnt_limited & balls,
        ("tendon", "drops the limits of tendons {}"): limited,
        ("body", "bodies {} do not move and have no joint; they are left out, because the base floats"):
            (model.body_rootid != root) & (np.arange(model.nbody) > 0) & (root > 0),
        (
            "joint", "free joints with armature, friction or springs are read as three slides and a ball, "
            "which have them in MuJoCo's rates"
        ): [bool(is_free) and split(compiled, number) for number, is_free in enumerate(free)],
    }  # fmt: skip
    return [
        note for (kind, text), which in found.items()
        for note in note_on(compiled, text, kind, np.flatnonzero(which).tolist())
    ]  # fmt: skip


def unread_options(compiled: Compiled, places: Mapping[str, str]) -> list[str]:
    """Return notes on contacts, and on what is not read of options.

    Args:
        places: Place of the first `<pair>`, `<flag>` and `<option>`, where there are any.
    """
    options, flags = compiled.model.opt, compiled.model.opt.disableflags
    off = [word for word in FLAGS if flags & max(compiled.code(f"mjDSBL_{word.upper()}"), 0)]
    option, flag = (places.get(tag, compiled.file) for tag in ("option", "flag"))
    contacts = places.get("pair") or _first_touching(compiled)
    found = {
        f"{option}: drops the forces of a fluid, of <option> {{}}":
            [word for word in ("density", "viscosity") if getattr(options, word)],
        f"{contacts}: contacts between geoms are not "
        "read: the robot touches nothing (the effect ground_contact has points on compliant ground)":
            [contacts] if contacts else [],
        f"{flag}: <flag> disables {{}}; hybridyn reads them all the same, for effects=": off,
    }  # fmt: skip
    return noted(found)


def _first_touching(compiled: Compiled) -> str:
    """Return the place of the first geom that could touch one of another body in MuJoCo, "" for none."""
    model = compiled.model
    if model.opt.disableflags & compiled.code("mjDSBL_CONTACT"):
        return ""
    for bit in range(32):
        masks = ((mask >> bit) & 1 == 1 for mask in (model.geom_contype, model.geom_conaffinity))
        first, second = (np.flatnonzero(mask).tolist() for mask in masks)
        if first and second and len({*model.geom_bodyid[first + second].tolist()}) > 1:
            return compiled.at("geom", min(first + second))
    return ""
