"""The exceptions of hybridyn.

    HybridynError
    |-- ModelError          the robot's files are wrong: file, line, element
    |-- TrajectoryError     a table is wrong: file, row, column
    |-- AssemblyError       loops do not close: module, leg, residual, iterations
    |-- SingularityError    a matrix lost rank: module, what, condition number
    |-- ActuationError      motors cannot produce the motion: module, direction, size
    `-- CompileError        a compiled model cannot be built: no compiler, or one that fails

Each message states what is wrong, where by name, the number against its threshold, and how to mend it. Each
error has its data as attributes, so that a program can act on it. Who catches an error may change its data;
the sentence is composed of them when it is read.
"""

from __future__ import annotations

from typing import Any

#: Maximum length of a message: a longer one consists mostly of names from a file.
LONGEST = 1000
#: Number of characters kept at the end of a long message, where the advice is.
END = 300
#: Stands in the text of an error for its sample: " at sample 7", or nothing if the place names the row.
AT_SAMPLE = "{at its sample}"


def shortened(message: str) -> str:
    """Return a message of readable length, leaving out the middle of a long one."""
    if len(message) <= LONGEST:
        return message
    return f"{message[: LONGEST - END - 5]} ... {message[-END:]}"


def install_advice(extra: str) -> str:
    """Return the advice how to install an extra, from a clone and from a release.

    Args:
        extra: Name of the extra in `pyproject.toml`.
    """
    return f"install it with `pip install -e '.[{extra}]'` in a clone, or `pip install 'hybridyn[{extra}]'`"


def required(module: str, extra: str, who: str) -> Any:
    """Import a package of an extra.

    Args:
        module: The package, or a module of it.
        extra: Name of the extra in `pyproject.toml`.
        who: What needs it.

    Raises:
        HybridynError: It is not installed.
    """
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise HybridynError(f"{who} needs {module.partition('.')[0]}: {install_advice(extra)}") from error


class PerformanceWarning(UserWarning):
    """The program calls hybridyn in a way that is much slower than another one.

    Example:
        >>> import warnings
        >>> warnings.simplefilter("ignore", hybridyn.PerformanceWarning)
    """


class HybridynError(Exception):
    """Base class of all errors that hybridyn raises deliberately.

    Attributes:
        place: Where it is wrong, before the message: file, line or row, outermost first. Empty if unknown.
        sample: Index of the sample in the batch (from 0), or None.
        row_named: Whether `place` names the row of the sample.
        advice: How to mend it, after the message, if who catches the error knows more.

    Example:
        >>> try:
        ...     hybridyn.assemble(hybridyn.load("five_bar"), motors=[0.1])
        ... except hybridyn.HybridynError as error:
        ...     print(str(error).split(";")[0])
        motors has shape (1,)
    """

    def __init__(self, text: str = "", *, place: str = "", sample: int | None = None) -> None:
        super().__init__(text)
        self.place, self.sample, self.row_named, self.advice = place, sample, False, ""

    def within(self, place: str, *, row_named: bool = False) -> None:
        """Add the place in which it was caught, such as the file of a table, or a row of it."""
        self.place = f"{place}: {self.place}" if self.place else place
        self.row_named = self.row_named or row_named

    @property
    def message(self) -> str:
        """The message without its place."""
        at = "" if self.sample is None or self.row_named else f" at sample {self.sample}"
        return super().__str__().replace(AT_SAMPLE, at) + self.advice

    def __str__(self) -> str:
        """Return place and message, shortened where they are long."""
        return shortened(f"{self.place}: {self.message}" if self.place else self.message)


class ModelError(HybridynError):
    """A robot's description is wrong or not supported.

    Attributes:
        file: Path of the file, or None.
        line: Line in the file (from 1), or None.
        element: Name of the link, joint, closure or tag, or None.

    Example:
        >>> try:
        ...     hybridyn.load("five_bar", motors=["m1_left_driv"])
        ... except hybridyn.ModelError as error:
        ...     print(error.element)
        m1_left_driv
    """

    def __init__(
        self, message: str, *, file: str | None = None, line: int | None = None, element: str | None = None
    ) -> None:
        super().__init__(message, place=f"{file}:{line}" if file and line else file or "")
        self.file, self.line, self.element = file, line, element


class TrajectoryError(HybridynError):
    """A table of samples is wrong.

    Attributes:
        file: Path of the table, or None for arrays.
        row: Number of the data row (from 1, the header not counted), or None.
        column: Name of the column, or None.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> try:
        ...     hybridyn.idm(robot, [0.0] * 3, [0.0] * 4, [0.0] * 4)
        ... except hybridyn.TrajectoryError as error:
        ...     print(str(error).split(";")[0])
        q has shape (3,)
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        row: int | None = None,
        column: str | None = None,
        sample: int | None = None,
    ) -> None:
        parts = [str(file)] if file else []
        parts += [f"row {row}"] if row is not None else []
        parts += [f"column '{column}'"] if column else []
        super().__init__(message, place=", ".join(parts), sample=sample)
        self.file, self.row, self.column = file, row, column


class AssemblyError(HybridynError):
    """The loops do not close.

    Attributes:
        module: Name of the module, or None.
        leg: Name of the leg with the worst closure, or None.
        residual: Closure residual reached, relative to the module's length, or None.
        iterations: Newton iterations spent, or None.
        open_freedoms: Number of freedoms that the given positions and poses do not determine, or None.
        undriven: Number of the module's freedoms that no motor drives, if freedoms are open.
        distance: By how much the joint that is named moves from where the motion ends to a singular posture,
            about, [m or rad], or None.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> try:
        ...     hybridyn.assemble(robot, platforms={"m1_tool": {"x": 0.0, "z": -5.0}})
        ... except hybridyn.AssemblyError as error:
        ...     print(error.module)
        m1_right_lower
    """

    def __init__(
        self,
        message: str,
        *,
        module: str | None = None,
        leg: str | None = None,
        sample: int | None = None,
        residual: float | None = None,
        iterations: int | None = None,
        open_freedoms: int | None = None,
        undriven: int = 0,
        distance: float | None = None,
    ) -> None:
        super().__init__(message, sample=sample)
        self.module, self.leg = module, leg
        self.residual, self.iterations, self.open_freedoms = residual, iterations, open_freedoms
        self.undriven, self.distance = undriven, distance


class SingularityError(HybridynError):
    """The matrix of a linear system lost rank.

    Attributes:
        module: Name of the module, or None.
        what: What lost rank ("legs", "motors", "inertia", ...), or None.
        condition: Its condition number (scaled), or None.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> try:
        ...     hybridyn.operational_inertia(robot, robot.home, "m1_tool")
        ... except hybridyn.SingularityError as error:
        ...     print(error.what)
        operational inertia
    """

    def __init__(
        self,
        message: str,
        *,
        module: str | None = None,
        what: str | None = None,
        condition: float | None = None,
        sample: int | None = None,
    ) -> None:
        super().__init__(message, sample=sample)
        self.module, self.what, self.condition = module, what, condition


class ActuationError(HybridynError):
    """The motors cannot produce the required efforts.

    Attributes:
        module: Name of the module, or None.
        direction: Text that names the missing direction, or None.
        size: Missing effort along it [N or N m], or None.

    Example:
        >>> robot = hybridyn.load("five_bar", motors=["m1_left_drive"])
        >>> q, v, a = hybridyn.assemble(robot, motors={"m1_left_drive": 0.1, "m1_right_drive": 0.2})
        >>> try:
        ...     hybridyn.idm(robot, q, v, a)
        ... except hybridyn.ActuationError as error:
        ...     print(error.module)
        m1_right_lower
    """

    def __init__(
        self,
        message: str,
        *,
        module: str | None = None,
        direction: str | None = None,
        size: float | None = None,
        sample: int | None = None,
    ) -> None:
        super().__init__(message, sample=sample)
        self.module, self.direction, self.size = module, direction, size


class CompileError(HybridynError):
    """A compiled model cannot be built; the general path works without it.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> try:
        ...     fast = hybridyn.compile(robot)
        ... except hybridyn.CompileError:
        ...     fast = None  # hybridyn.idm and ddm work without
    """
