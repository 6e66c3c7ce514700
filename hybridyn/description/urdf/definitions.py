"""What a xacro file defines: properties, arguments, and macros with their parameters."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

from .elements import Tag
from .scopes import Scope, is_name
from .texts import Texts

#: A parameter with a default, which a quote may hold together; `^` takes the caller's value of the name.
#: What a default holds is never divided in another way, for which there are exponentially many.
_DEFAULT = re.compile(
    r"""\s*([^\s:=]+?)\s*:?=\s*(\^\|?)?(\$\{.*?\}|\$\(.*?\)|(?:'.*?'|\".*?\"|[^\s'\"]+)++|)(?:\s+|$)(.*)"""
)


class Default(NamedTuple):
    """The default of a parameter.

    Attributes:
        forwards: Whether it is the caller's value of the parameter's name, where there is one.
        text: Its text, None without one.
    """

    forwards: bool
    text: str | None


class Macro(NamedTuple):
    """A macro.

    Attributes:
        name: Its name.
        parameters: Its parameters; "*name" is an element, "**name" the content of one.
        defaults: Defaults by parameter.
        body: Its element.
    """

    name: str
    parameters: tuple[str, ...]
    defaults: dict[str, Default]
    body: Tag


def stated(node: Tag, *needed: str, more: str = "", texts: Texts | None = None) -> list[Any]:
    """Return attributes of an element of xacro's: needed ones, and those in `more`, None where absent.

    Args:
        node: The element.
        needed: Names of attributes.
        more: Names of further ones.
        texts: Takes a note of others.

    Raises:
        ValueError: One is missing.
    """
    for name in needed:
        if name not in node.attributes:
            raise ValueError(f"{node.name}: missing attribute '{name}'")
    names = [*needed, *more.split()]
    others = [name for name in node.attributes if name not in names and not name.startswith("xmlns:")]
    if others and texts:
        texts.note(f"{node.name}: unknown attribute(s): {', '.join(others)}")
    return [node.attributes.get(name) for name in names]


def define_argument(node: Tag, scope: Scope, texts: Texts) -> None:
    """Define an argument."""
    name, default = stated(node, "name", "default", texts=texts)
    texts.declare(name, default, scope)


def define_macro(node: Tag, macros: Scope, texts: Texts) -> None:
    """Define a macro."""
    name, left = stated(node, "name", more="params", texts=texts)
    if name == "call" or "." in name:
        raise ValueError(f"a macro may not be called '{name}'")
    if name.startswith("xacro:"):
        texts.note(f"macro names must not contain prefix 'xacro:': {name}")
        name = name.removeprefix("xacro:")
    parameters, defaults = list[str](), dict[str, Default]()
    while left and left.strip():
        parameter, default, left = parameter_of(left)
        parameters.append(parameter)
        if default is not None:
            defaults[parameter] = default
    macros.put(name, Macro(name, tuple(parameters), defaults, node))


def parameter_of(text: str) -> tuple[str, Default | None, str]:
    """Return the first parameter of a text, its default, and the rest of the text."""
    if found := _DEFAULT.match(text):
        name, forwards, default, rest = found.groups()
        return name, Default(bool(forwards), default or None), rest
    name, *others = text.split(None, 1)
    return name, None, others[0] if others else ""


def define_property(node: Tag, scope: Scope, texts: Texts) -> None:
    """Define a property, or remove it."""
    words = "value default remove scope lazy_eval"
    name, value, default, remove, reach, lazy = stated(node, "name", more=words, texts=texts)
    name = str(texts.text(name, scope))
    if not is_name(name):
        raise ValueError(f"Property names must be valid python identifiers: {name}")
    removed = texts.holds(remove or "false", scope)
    if (value is not None) + (default is not None) + removed > 1:
        raise ValueError(f"Property attributes default, value, and remove are mutually exclusive: {name}")
    if removed and name in scope:
        if name in texts.symbols:
            texts.note(f"Cannot remove global symbol: {name}")
        scope.remove(name)
        return
    if default is not None:
        if reach is not None:
            texts.note(f"{name}: default property value can only be defined on local scope")
        if name in scope:
            return
        value = default
    target = {"global": scope.outermost, "parent": scope.caller}.get(reach or "", lambda: scope)()
    if target is None:
        raise ValueError(f"there is no scope around that of property '{name}'; remove scope=\"parent\"")
    is_lazy = texts.holds(lazy or "true", scope) and reach not in ("global", "parent")
    if value is None:
        target.put(f"**{name}", node)
    else:
        texts.put(target, name, value if is_lazy else texts.text(value, scope), lazy=is_lazy)
