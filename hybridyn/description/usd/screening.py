"""Refuse what changes the motion and is not read in a USD file, and collect the notes of what does not."""

from __future__ import annotations

import re
from collections.abc import Iterator

from .schema import (
    BESIDE,
    BODY,
    IGNORED,
    JOINTS,
    MENDS,
    NEEDS,
    NEUTRAL,
    NOTED,
    OF_CONTACTS,
    PHYSICS,
    READ,
    SCHEMAS,
    SPACES,
    TYPES,
)
from .stage import Prim, UsdStage

_AXIS = re.compile(r"^(drive|physxMimicJoint|physxJointAxis|physxLimit):[^:]*:")


def screen(stage: UsdStage) -> dict[str, list[str]]:
    """Refuse what cannot be read, and return remarks on what is left out with its names, as in `noted`.

    Raises:
        ModelError: A prim has a type, a schema or an attribute that changes the motion and is not read.
    """
    told = NEUTRAL | IGNORED
    noted: dict[str, list[str]] = {}
    for prim in stage.prims.values():
        if reason := _left_out(prim):
            noted.setdefault(reason, []).append(prim.path)
            continue
        _refuse_unknown(prim)
        for name in prim.attributes:
            general = _AXIS.sub(r"\1:{}:", name)
            neutral, text = told.get(general, ((), ""))
            value = prim.value(name) if text else None
            parts = value if isinstance(value, list) else [value]
            if value is None or any(all(part == one for part in parts) for one in neutral):
                continue
            if general in NEUTRAL:
                raise prim.error(f"'{name}' = {value} is not read; {text}")
            noted.setdefault(text, []).append(prim.path)
    unread = [name for prim in stage.prims.values() for name in _unread(prim)]
    return noted | {"attributes that other engines may use are not read: {}": unread}


def _left_out(prim: Prim) -> str:
    """Return why a prim is left out, "" if it is not."""
    names = " ".join((prim.kind, *prim.schemas))
    beside = (reason for part, reason in BESIDE.items() if part in names and prim.body is None)
    return NOTED.get(prim.kind) or next(beside, "")


def _refuse_unknown(prim: Prim) -> None:
    """Refuse a type or schema of physics that is not known."""
    schemas = (schema for schema in prim.schemas if schema.partition(":")[0] not in SCHEMAS)
    unknown = [f"schema {schema}" for schema in schemas if not any(part in schema for part in OF_CONTACTS)]
    if prim.kind not in TYPES and prim.flag("physics:jointEnabled", True):
        unknown.insert(0, f"a {prim.kind}")
    if prim.has(BODY) and prim.kind in JOINTS:
        raise prim.error(f"a joint is no body; remove {BODY}")
    for what in unknown:
        if what.rpartition(" ")[2].startswith(PHYSICS):
            raise prim.error(
                f"{what} is not read; {next(text for part, text in MENDS.items() if part in what)}"
            )


def _unread(prim: Prim) -> Iterator[str]:
    """Yield the names of attributes of joints and bodies that are neither read nor known to be harmless.

    Attributes of schemas that are not applied are not read, since USD leaves them out.
    """
    if not (prim.has(BODY) or prim.kind in JOINTS):
        return
    known = {*NEUTRAL, *IGNORED}
    general = {name: _AXIS.sub(r"\1:{}:", name) for name in prim.attributes if name.startswith(SPACES)}
    yield from (name for name, one in general.items() if not one.startswith(READ) and one not in known)
    applied = {*prim.schemas, *(["PhysicsMassAPI"] if prim.has("NewtonMassAPI") else [])}
    for name in prim.attributes:
        for start, schema in NEEDS.items():
            instance = f":{name.split(':')[1]}" if name.startswith(start) and start.endswith(":") else ""
            if name.startswith(start) and schema + instance not in applied:
                yield name
