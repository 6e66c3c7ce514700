"""Expand one xacro file: macros, properties, includes, conditions, blocks and texts, as xacro does.

Elements are made anew from those of the files, which stay as they are. xacro itself, whose expressions run
Python and whose files are any, judges in the tests.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import ModelError
from ..bounds import RunawayError
from ..shipped import shown
from .definitions import Default, Macro, define_argument, define_macro, define_property, stated
from .elements import Tag, read_tags, written
from .robot_folders import RobotFolders
from .scopes import Scope, truth
from .texts import Texts, described

#: What an element or text, and an attribute take, and what a macro or block counts for its time [bytes].
NODE, ATTRIBUTE, USED = 400, 500, 1000


class Around(NamedTuple):
    """What is around an element.

    Attributes:
        macros: Macros by name.
        symbols: Values by name; a block `b` is "*b", its content "**b".
        owner: Attributes of the element that is made around it.
    """

    macros: Scope
    symbols: Scope
    owner: dict[str, str]


class Expansion:
    """One expansion.

    Attributes:
        text: The text of the expansion.
        texts: Evaluates the texts of the file.
        notes: xacro's warnings.
        folders: The robot's folders, which know what was asked of them.
    """

    def __init__(self, file: str, folders: RobotFolders, given: Mapping[str, str], *, traced: bool) -> None:
        """Expand a file.

        Raises:
            ModelError: xacro reports an error, or the expansion cannot be traced.
            RunawayError: The expansion makes too much.
        """
        self.folders, self.texts = folders, Texts(folders, given, traced=traced)
        self.notes, self._calls = self.texts.notes, list[str]()
        try:
            around = Around(self._scope({}), self._scope(self.texts.symbols), {})
            made = self._made(self._read(folders.file), around)
            if unknown := [name for name in given if name not in self.texts.asked]:
                declared = ", ".join(f"'{name}'" for name in self.texts.asked) or "none"
                raise ModelError(f"there is no argument '{unknown[0]}'; the file's arguments: {declared}")
            text = written(made)
        except Exception as error:
            raise self._failure(error, file) from None
        finally:
            folders.closed = True
        self.text = self.texts.trace.text(text) if traced else text

    def again(self, given: Mapping[str, str]) -> str:
        """Return the text of the expansion with other arguments of the same names.

        Raises:
            UntracedError: The file has to be expanded as a whole.
            Exception: Any error of an expression.
        """
        self.folders.budget.restart("made")
        return self.texts.trace.again(given)

    def _scope(self, around: Scope | Mapping[str, Any], *, is_space: bool = False) -> Scope:
        return Scope(around, self.texts.value, is_space=is_space)

    def _read(self, path: str) -> Tag:
        """Return the root element of a file."""
        content = self.texts.content(path)
        self.folders.budget.spend("made", len(content) + NODE * content.count(b"<"))
        return read_tags(content, "" if path == self.folders.file else shown(Path(path)))

    def _content(self, nodes: Sequence[Tag | str], around: Around) -> list[Tag | str]:
        """Return what elements and texts become.

        What a condition holds stands in its place without a call of this function, so that macros may call
        themselves as often as in xacro.
        """
        out, texts = list[Tag | str](), self.texts
        waiting = [(iter(nodes), around, texts.at)]
        while waiting:
            rest, around, here = waiting[-1]
            texts.at = here
            node = next(rest, None)
            if node is None:
                waiting.pop()
            elif isinstance(node, str):
                self.folders.budget.spend("made", NODE + len(node))
                out.append(str(texts.text(node, around.symbols)))
            else:
                texts.at = node
                if node.name == "xacro:element":
                    node = self._named(node, around)
                if node.name in ("xacro:if", "xacro:unless"):
                    if self._holds(node, around):
                        waiting.append((iter(node.children), around._replace(owner={}), node))
                elif node.name in MAKERS:
                    out += MAKERS[node.name](self, node, around) or ()
                elif node.name.startswith("xacro:"):
                    out += self._called(node, around)
                else:
                    out.append(self._made(node, around))
        return out

    def _made(self, node: Tag, around: Around) -> Tag:
        """Return an element, whose attributes and content are evaluated."""
        self.texts.at = node
        made = {
            name: str(self.texts.text(value, around.symbols))
            for name, value in node.attributes.items()
            if not name.startswith("xacro:") and name != "xmlns:xacro"
        }
        self.folders.budget.spend("made", NODE + ATTRIBUTE * len(made))
        children = self._content(node.children, around._replace(owner=made))
        return Tag(node.name, made, children, node.place)

    def _named(self, node: Tag, around: Around) -> Tag:
        """Return an element whose name is evaluated."""
        (said,) = stated(node, "xacro:name")
        name = str(self.texts.text(said, around.symbols))
        if not name:
            raise ValueError("xacro:element: empty name")
        return node._replace(name=name)

    def _holds(self, node: Tag, around: Around) -> bool:
        """Return whether the content of a condition stands."""
        self.folders.budget.spend("made", USED)
        (condition,) = stated(node, "value", texts=self.texts)
        return self.texts.holds(condition, around.symbols) == (node.name == "xacro:if")

    def _attribute(self, node: Tag, around: Around) -> None:
        """Set an attribute of the element around."""
        name, value = (str(self.texts.text(one, around.symbols)) for one in stated(node, "name", "value"))
        if not name:
            raise ValueError("xacro:attribute: empty name")
        around.owner[name] = value

    def _included(self, node: Tag, around: Around) -> list[Tag | str]:
        """Return the content of files."""
        name, space, optional = stated(node, "filename", more="ns optional", texts=self.texts)
        if node.elements():
            self.texts.note("Child elements of a <xacro:include> tag are ignored")
        inside = around
        if space:
            space = str(self.texts.text(space, around.symbols))
            inside = Around(self._scope({}, is_space=True), self._scope(around.symbols, is_space=True), {})
            around.macros.put(space, inside.macros)
            around.symbols.put(space, inside.symbols)
        out = list[Tag | str]()
        for path in self._located(self.texts.text(name, around.symbols)):
            self.texts.files.append(path)
            try:
                root = self._read(path)
            except OSError:
                self.texts.files.pop()
                if truth(optional):
                    continue
                raise
            made = self._made(root, inside)
            self.texts.files.pop()
            self._lift(made.attributes, around)
            out += made.children
        return out

    def _located(self, name: Any) -> list[str]:
        """Return the paths of files that are included."""
        name = self.texts.trace.chosen(str, name)
        path = self.texts.absolute(name)
        if name.startswith("package://"):
            package, _, rest = name.removeprefix("package://").partition("/")
            path = os.path.join(self.folders.ask("find", package), rest)
        if not re.search(r"[*?[]", path):
            return [path]
        if not (found := self.folders.ask("match", path)):
            self.texts.note(f"the pattern '{path}' matches no file")
        return list(found)

    def _lift(self, attributes: Mapping[str, str], around: Around) -> None:
        """Declare name spaces of XML in the element around."""
        for name, value in attributes.items():
            if name.startswith("xmlns:") and around.owner.setdefault(name, value) != value:
                self.texts.note(f"inconsistent namespace redefinitions for {name}")

    def _inserted(self, node: Tag, around: Around) -> list[Tag | str]:
        """Return a block."""
        (name,) = stated(node, "name", texts=self.texts)
        key = next((key for key in (f"**{name}", f"*{name}") if key in around.symbols), None)
        if key is None:
            raise ValueError(f'Undefined block "{name}"')
        self.folders.budget.spend("made", USED)
        made = self._made(around.symbols[key], around)
        return made.children if key.startswith("**") else [made]

    def _called(self, node: Tag, around: Around) -> list[Tag | str]:
        """Return what a macro makes of its parameters and blocks."""
        macro, inside, attributes = self._found(node, around)
        self._calls.append(macro.name)
        self.folders.budget.spend("made", USED)
        left = [*macro.parameters]
        for name, value in attributes.items():
            if name not in left:
                raise ValueError(f'Invalid parameter "{name}"')
            left.remove(name)
            self.texts.put(inside.symbols, name, self.texts.text(value, around.symbols))
        content = self._content(node.children, around._replace(owner={}))
        blocks = [one for one in content if isinstance(one, Tag)]
        wanted = [name for name in left if name.startswith("*")]
        if len(blocks) < len(wanted):
            raise ValueError("Not enough blocks")
        if len(blocks) > len(wanted):
            raise ValueError(f'Unused block "{blocks[len(wanted)].name}"')
        for name, block in zip(wanted, blocks, strict=True):
            inside.symbols.put(name, block)
        self._by_default(macro, [name for name in left if name not in wanted], inside, around)
        out = self._content(macro.body.children, inside)
        self._lift(macro.body.attributes | inside.owner, around)
        self._calls.pop()
        return out

    def _found(self, node: Tag, around: Around) -> tuple[Macro, Around, dict[str, str]]:
        """Return the macro that an element calls, with scopes of its own, and the attributes for it."""
        attributes, name = dict(node.attributes), node.name.removeprefix("xacro:")
        if name == "call":
            (said,) = stated(node, "macro")
            name = str(self.texts.text(said, around.symbols))
            del attributes["macro"]
        macros, symbols = around.macros, around.symbols
        *spaces, last = [name] if name in macros else name.split(".")
        for space in spaces:
            if space not in macros or not isinstance(macros[space], Scope):
                raise ValueError(f"unknown macro name: xacro:{name}")
            macros, symbols = macros[space], symbols[space]
        if last not in macros or not isinstance(macros[last], Macro):
            raise ValueError(f"unknown macro name: xacro:{name}")
        return macros[last], Around(self._scope(macros), self._scope(symbols), {}), attributes

    def _by_default(self, macro: Macro, names: Sequence[str], inside: Around, around: Around) -> None:
        """Set parameters that are not given."""
        missing = list[str]()
        for name in names:
            default = macro.defaults.get(name, Default(False, None))
            if default.forwards and name in around.symbols:
                self.texts.put(inside.symbols, name, around.symbols[name])
            elif default.text is not None:
                self.texts.put(inside.symbols, name, self.texts.text(default.text, around.symbols))
            elif default.forwards:
                raise ValueError(f"Undefined property to forward: {name}")
            else:
                missing.append(name)
        if missing:
            raise ValueError(f"Undefined parameters [{','.join(missing)}]")

    def _failure(self, error: Exception, file: str) -> ModelError:
        """Return an error as one line of text with its macros, and the file and line where it occurred."""
        message = "xacro: " + " ".join(described(error).split())
        if expression := getattr(error, "evaluated", ""):
            message += f" when evaluating expression '{expression}'"
        if self._calls:
            message += f" (in macro {' < '.join([*reversed(self._calls)][:4])})"
        path = self.texts.files[-1]
        where = os.path.relpath(path) if path != os.path.abspath(file) else file
        line = getattr(error, "lineno", None) or getattr(error, "line", None)  # of expat, and of a DOCTYPE
        if line is None and self.texts.at:
            where, line = self.texts.at.place[0] or file, self.texts.at.place[1]
        kind = RunawayError if isinstance(error, RunawayError) else ModelError
        return kind(message, file=where, line=line)


#: What each element of xacro's becomes.
MAKERS: dict[str, Callable[[Expansion, Tag, Around], list[Tag | str] | None]] = {
    "xacro:property": lambda one, node, around: define_property(node, around.symbols, one.texts),
    "xacro:arg": lambda one, node, around: define_argument(node, around.symbols, one.texts),
    "xacro:macro": lambda one, node, around: define_macro(node, around.macros, one.texts),
    "xacro:attribute": Expansion._attribute, "xacro:include": Expansion._included,
    "xacro:insert_block": Expansion._inserted,
}  # fmt: skip
