"""Methods that are called when somebody takes a robot's Pinocchio model, and may change it from then on."""

from __future__ import annotations

from collections.abc import Callable
from weakref import WeakMethod


class ModelReaders:
    """Methods of objects that live no longer for being kept here. A pickled robot has none."""

    def __init__(self) -> None:
        self._methods: list[WeakMethod[Callable[[], None]]] = []

    def __reduce__(self) -> tuple[type[ModelReaders], tuple[()]]:
        return ModelReaders, ()

    def add(self, method: Callable[[], None]) -> None:
        """Keep a bound method."""
        self._methods = [kept for kept in self._methods if kept() is not None]
        self._methods.append(WeakMethod(method))

    def tell(self) -> None:
        """Call every method whose object still lives."""
        for kept in self._methods:
            if (method := kept()) is not None:
                method()
