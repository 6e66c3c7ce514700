"""What other packages add: entry points of the groups `hybridyn.KIND`, asked for where a table lacks a name.

    [project.entry-points."hybridyn.effects"]
    magnet = "my_package:Magnet"

The names of hybridyn itself come first, and cost nothing: `importlib.metadata` is asked for the others, once
for each kind. Only what is used is imported, and checked by the room whose kind it is.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from .errors import HybridynError, ModelError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


class Kind(NamedTuple):
    """What packages can add, in the group `hybridyn.KIND`.

    Attributes:
        word: What one is called.
        own: Where the names of hybridyn's own ones are, module and name.
        check: A function that returns what an entry point leads to, in the form that it is used in; it raises
            a ModelError if it cannot be used.
    """

    word: str
    own: str
    check: str


KINDS = {
    "effects": Kind("effect", "effects.catalogue:UNITS", "effects.catalogue:checked_effect"),
    "formats": Kind(
        "robot format", "description.added_formats:ENDINGS", "description.added_formats:checked_format"
    ),
    "measures": Kind("measure", "studies.sweep.measures:OWN", "studies.sweep.added_measures:checked_measure"),
    "parameters": Kind(
        "kind of parameter",
        "structure.parameters.entries:KINDS",
        "structure.parameters.entries:checked_parameter",
    ),
    "controllers": Kind(
        "controller", "scenes.controller_tables:CONTROLLERS", "scenes.added_controllers:checked_controller"
    ),
    "closures": Kind(
        "closure", "description.closure_forms:FORMS", "description.residual_closures:checked_closure"
    ),
    "engines": Kind("engine", "studies.compare.methods:ENGINES", "studies.compare.methods:checked_engine"),
}


class Extension(NamedTuple):
    """What a package adds under a name.

    Attributes:
        name: The name.
        package: The package, as it was installed.
        value: What the entry point leads to.
        version: Version of the package.
    """

    name: str
    package: str
    value: Any
    version: str = ""

    def refused(self, kind: str, why: str) -> ModelError:
        """Return the error that says why it cannot be used."""
        return refused(kind, self.name, self.package, why)


def refused(kind: str, name: str, package: str, why: str) -> ModelError:
    """Return the error that says why what a package adds cannot be used."""
    return ModelError(f"the {KINDS[kind].word} '{name}' of the package '{package}' {why}", element=name)


@contextmanager
def running(kind: str, name: str, package: str, file: str = "") -> Iterator[None]:
    """Let errors of a package's code name the package; those of hybridyn pass.

    Args:
        kind: One of `KINDS`.
        name: Name of what the package adds.
        package: The package.
        file: The file that its code reads or writes, if any.

    Raises:
        ModelError: The code fails.
    """
    try:
        yield
    except HybridynError:
        raise
    except Exception as error:  # whatever the package raises
        told = refused(kind, name, package, f"fails: {type(error).__name__}: {error}")
        told.within(file)
        raise told from error


def added_names(kind: str) -> tuple[str, ...]:
    """Return the names that packages add to those of hybridyn, in alphabetical order.

    Args:
        kind: One of `KINDS`.

    Raises:
        ModelError: Two packages have one name, or a package has a name of hybridyn.
    """
    found = _points(kind)
    for name, claims in found.items():
        if name in _own(kind):
            raise refused(kind, name, _package(claims[0]), "has a name of hybridyn's own; rename it")
        if len(claims) > 1:
            packages = " and ".join(sorted(f"'{_package(claim)}'" for claim in claims))
            raise ModelError(
                f"the packages {packages} both add the {KINDS[kind].word} '{name}': remove one of them",
                element=name,
            )
    return tuple(sorted(found))


def added(kind: str, name: str) -> Any:
    """Return what a package adds under a name, or None if no package does: a name of hybridyn asks for none.

    Args:
        kind: One of `KINDS`.
        name: The name.

    Raises:
        ModelError: As `added_names`, or it cannot be imported or used.
    """
    return _loaded(kind, name) if name not in _own(kind) and name in added_names(kind) else None


def every_name(kind: str, asked: Iterable[str] | None = None, first: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the names of hybridyn and of packages; only hybridyn's own, if no others are asked for.

    Args:
        kind: One of `KINDS`.
        asked: Names that are asked for; None returns every name.
        first: Words of hybridyn that stand before its names.

    Raises:
        ModelError: As `added_names`.
    """
    own = (*first, *_own(kind))
    return own if asked is not None and {*asked} <= {*own} else (*own, *added_names(kind))


def _own(kind: str) -> Collection[str]:
    """Return the names of hybridyn."""
    own: Collection[str] = _named(KINDS[kind].own)
    return own


def _named(place: str) -> Any:
    """Return what has a place in hybridyn, written as an entry point is."""
    module, _, name = place.partition(":")
    return getattr(import_module(f"hybridyn.{module}"), name)


@cache
def _points(kind: str) -> dict[str, list[EntryPoint]]:
    """Return the entry points of a group by name; one that is found twice in the same place counts once."""
    from importlib.metadata import entry_points  # 10 ms, and 40 more where nothing else imports it

    out: dict[str, list[EntryPoint]] = {}
    for point in sorted(set(entry_points(group=f"hybridyn.{kind}")), key=_package):
        out.setdefault(point.name, []).append(point)
    return out


@cache
def _loaded(kind: str, name: str) -> Any:
    """Import what an entry point leads to, and check it.

    Raises:
        ModelError: It cannot be imported or used.
    """
    (point,) = _points(kind)[name]
    try:
        version = point.dist.version if point.dist else ""
        found = Extension(name, _package(point), point.load(), version)
    except Exception as error:  # whatever the package raises
        why = f"cannot be imported from '{point.value}': {type(error).__name__}: {error}"
        raise refused(kind, name, _package(point), why) from error
    return _named(KINDS[kind].check)(found)


def _package(point: EntryPoint) -> str:
    """Return the name of the package of an entry point."""
    return point.dist.name if point.dist else point.module.partition(".")[0]
