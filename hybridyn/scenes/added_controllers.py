"""Controllers that other packages add: tables `[controller]` with a `kind` of theirs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, TypeVar

from pydantic import BaseModel, create_model

from ..description.side_cars.tables import Schema, keys_of, table
from ..extensions import Extension, added, every_name, refused, running
from ..simulation.motion_law import Effort
from ..structure.robot import HybridRobot

File = TypeVar("File", bound=BaseModel)


class Maker(NamedTuple):
    """What makes a controller.

    Attributes:
        make: Returns a law of (t, q, v), from a robot and the values of the table.
        package: Its package.
        keys: Type of the value of each key.
    """

    make: Any
    package: str
    keys: dict[str, Any]


def checked_controller(found: Extension) -> Maker:
    """Return what makes the controller that a package adds.

    Raises:
        ModelError: It cannot be called with a robot, or an argument has no type, or is called `kind`.
    """
    if not callable(found.value):
        raise found.refused("controllers", f"is {found.value!r}, no function of a robot and its keys")
    keys = keys_of("controllers", found.name, found.package, found.value, given=1)
    if "kind" in keys:
        why = "has an argument 'kind', the key that names it in its table; rename the argument"
        raise found.refused("controllers", why)
    return Maker(found.value, found.package, keys)


def kinds_of_controllers() -> tuple[str, ...]:
    """Return every kind of controller.

    Raises:
        ModelError: Two packages add controllers of one kind.
    """
    return every_name("controllers")


def with_added_controller(schema: type[File], content: Mapping[str, Any]) -> type[File]:
    """Return the schema of a file, whose table `controller` is that of a package if it states such a kind.

    Args:
        schema: The schema without it.
        content: The content of the file.

    Raises:
        ModelError: The controller cannot be used.
    """
    stated = content.get("controller")
    kind = stated.get("kind") if isinstance(stated, Mapping) else None
    if "controller" not in schema.model_fields or not isinstance(kind, str):
        return schema
    maker: Maker | None = added("controllers", kind)
    if maker is None:
        return schema
    own = table("AddedController", Schema, kind=Literal[kind], **maker.keys)
    return create_model(schema.__name__, __base__=schema, controller=(own, ...))


def added_law(robot: HybridRobot, stated: Schema) -> Effort:
    """Return the law of a controller of a package.

    Raises:
        ModelError: Its code fails, or returns no law.
    """
    values = stated.stated()
    kind = values.pop("kind")
    maker: Maker = added("controllers", kind)
    with running("controllers", kind, maker.package):
        law: Effort = maker.make(robot, **values)
    if not callable(law):
        raise refused("controllers", kind, maker.package, f"must return a function of (t, q, v), not {law!r}")
    return law
