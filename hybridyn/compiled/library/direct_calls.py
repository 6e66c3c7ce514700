"""Call C functions of NumPy arrays through the interface of CPython, without the overhead of ctypes."""

from __future__ import annotations

import ctypes
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from ...spatial import Array

#: Type of positions, rates and accelerations of motors, for models in single precision, too.
DOUBLE = np.dtype(np.float64)

#: Status of a single call whose arguments are not contiguous arrays of the library's type.
REFUSED = 1

#: CPython's flag for a C function that receives its arguments in one array.
METH_FASTCALL = 0x0080

#: Status of a single call: done, refused, or done but the guard is above its limit.
ANSWERS = (0, REFUSED, 2)


#: Kinds of numbers that are converted to double precision; the general path checks others.
CONVERTED = "fiu"


def refuse(*_: object) -> int:
    """Refuse every single call; stands for a C call that there is not."""
    return REFUSED


def readable(*given: Any) -> tuple[Array, ...] | None:
    """Return numbers as contiguous arrays in double precision, which C reads.

    Args:
        given: Arguments of a call that C has refused.

    Returns:
        The arrays; None if they were readable before, or one of them is no array, list or tuple of numbers.
    """
    arrays = []
    for x in given:
        try:
            array = np.asarray(x) if type(x) in (np.ndarray, list, tuple) else None
        except ValueError:  # rows of different lengths
            return None
        if array is None or array.dtype.kind not in CONVERTED:
            return None
        array = array.copy() if array.size == 1 else array  # whose stride may be any, and is contiguous
        arrays.append(np.require(array, DOUBLE, ("C", "A")))
    return None if all(map(operator.is_, arrays, given)) else tuple(arrays)


def again(call: Callable[..., int], given: tuple[Any, ...], out: Array) -> int:
    """Call C once more, where it has refused, with arguments that it reads; return its status."""
    copies = readable(*given)
    return REFUSED if copies is None else call(*copies, out)


class MethodDef(ctypes.Structure):
    """CPython's `PyMethodDef`: a C function that Python calls directly, without ctypes."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


#: Structures of functions: CPython reads them as long as it may call the functions.
_KEPT: list[MethodDef] = []


def function_of(held: ctypes.PyDLL, name: str, given: Any = None) -> Callable[..., int]:
    """Return a function of a library, METH_FASTCALL, which receives `given` as its first argument in C."""
    address = ctypes.cast(getattr(held, name), ctypes.c_void_p)
    _KEPT.append(MethodDef(name.encode(), address, METH_FASTCALL))
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.restype = ctypes.py_object
    new.argtypes = [ctypes.POINTER(MethodDef), ctypes.py_object, ctypes.c_void_p]
    made: Callable[..., int] = new(ctypes.byref(_KEPT[-1]), given, None)
    return made


def knows_arrays(held: ctypes.PyDLL, dtype: np.dtype[Any]) -> bool:
    """Set up the reading of NumPy arrays in C, and return whether C sees their layout correctly."""
    held.hybridyn_setup.argtypes = [ctypes.c_void_p] * 4
    held.hybridyn_setup.restype = None
    answers = (ctypes.c_void_p * len(ANSWERS))(*map(id, ANSWERS))
    increment = ctypes.cast(ctypes.pythonapi.Py_IncRef, ctypes.c_void_p)
    held.hybridyn_setup(id(np.ndarray), id(dtype), answers, increment)
    held.hybridyn_layout.argtypes = [ctypes.py_object, ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong]
    held.hybridyn_layout.restype = ctypes.c_int
    for shape in ((3, 5), (7, 2)):
        array = np.zeros(shape, dtype)
        usual = type(array) is np.ndarray and array.dtype is dtype
        if not (usual and held.hybridyn_layout(array, array.ctypes.data, shape[0], dtype.itemsize)):
            return False
    return True
