"""Deny files, network and programs to this process, with two mechanisms of the Linux kernel.

seccomp: only the system calls of a computation on open pipes are allowed. Every other call fails with EPERM,
among them all calls that open a file or a socket, start a program, or inspect or signal a process.
Landlock: an independent part of the kernel denies files and the network a second time.

Both are permanent for the process and need no privileges. On other systems, `lock` does nothing.
"""

from __future__ import annotations

import ctypes
import platform
import struct
import sys

_SET_NO_NEW_PRIVS, _SET_SECCOMP, _FILTER = 38, 22, 2
_LOAD, _JUMP_EQUAL, _RETURN = 0x20, 0x15, 0x06  # instructions of the filter
_ALLOW, _NOT_PERMITTED = 0x7FFF0000, 0x00050001  # its return values; the second carries EPERM
_AT_NUMBER, _AT_MACHINE = 0, 4  # offsets in the data that it examines

_CALLS_X86 = {
    "read": 0, "write": 1, "close": 3, "fstat": 5, "lseek": 8, "mmap": 9, "mprotect": 10, "munmap": 11,
    "brk": 12, "rt_sigaction": 13, "rt_sigprocmask": 14, "rt_sigreturn": 15, "sched_yield": 24, "mremap": 25,
    "madvise": 28, "getpid": 39, "exit": 60, "gettimeofday": 96, "sysinfo": 99, "sigaltstack": 131,
    "gettid": 186, "time": 201, "futex": 202, "restart_syscall": 219, "clock_gettime": 228, "exit_group": 231,
    "getrandom": 318, "membarrier": 324, "rseq": 334,
}  # fmt: skip
_CALLS_ARM = {
    "close": 57, "lseek": 62, "read": 63, "write": 64, "fstat": 80, "exit": 93, "exit_group": 94, "futex": 98,
    "clock_gettime": 113, "sched_yield": 124, "restart_syscall": 128, "sigaltstack": 132, "rt_sigaction": 134,
    "rt_sigprocmask": 135, "rt_sigreturn": 139, "gettimeofday": 169, "getpid": 172, "gettid": 178,
    "sysinfo": 179, "brk": 214, "munmap": 215, "mremap": 216, "mmap": 222, "mprotect": 226, "madvise": 233,
    "getrandom": 278, "membarrier": 283, "rseq": 293,
}  # fmt: skip
#: The kernel's number of each machine (AUDIT_ARCH), and the system calls that are allowed on it.
_MACHINES = {"x86_64": (0xC000003E, _CALLS_X86), "aarch64": (0xC00000B7, _CALLS_ARM)}

_CREATE_RULESET, _RESTRICT_SELF = 444, 446  # the same numbers on every machine
_VERSION = 1
#: Number of file rights in each version of Landlock, from the first version on.
_FILE_RIGHTS = (13, 14, 15, 15, 16)
_NETWORK_FROM, _NETWORK_RIGHTS = 4, 0b11  # to bind and to connect
_SCOPES_FROM, _SCOPES = 6, 0b11  # sockets with abstract names, and signals


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("instructions", ctypes.c_char_p))


def lock() -> list[str]:
    """Restrict this process, as far as the kernel supports it.

    Returns:
        Names of the active locks: "Landlock", "seccomp", both or none.
    """
    if not sys.platform.startswith("linux"):
        return []
    kernel = ctypes.CDLL(None)
    kernel.prctl.argtypes = [ctypes.c_int, *4 * [ctypes.c_ulong]]
    kernel.syscall.restype = ctypes.c_long
    if kernel.prctl(_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        return []
    locks = (("Landlock", _landlock), ("seccomp", _seccomp))
    return [name for name, close in locks if close(kernel)]


def _landlock(kernel: ctypes.CDLL) -> bool:
    """Drop every right to files and network that Landlock supports; return whether that succeeded."""
    version = kernel.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION)
    if version < 1:
        return False
    files = (1 << _FILE_RIGHTS[min(version, len(_FILE_RIGHTS)) - 1]) - 1
    rights = [files]
    if version >= _NETWORK_FROM:
        rights.append(_NETWORK_RIGHTS)
    if version >= _SCOPES_FROM:
        rights.append(_SCOPES)
    attributes = struct.pack(f"={len(rights)}Q", *rights)
    rules = kernel.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    return bool(rules >= 0 and kernel.syscall(_RESTRICT_SELF, ctypes.c_int(rules), 0) == 0)


def _seccomp(kernel: ctypes.CDLL) -> bool:
    """Allow only the system calls that a computation needs; return whether that succeeded."""
    machine = platform.machine()
    if machine not in _MACHINES or struct.calcsize("P") != 8:
        return False
    identity, calls = _MACHINES[machine]
    numbers = sorted(calls.values())
    steps = [(_LOAD, 0, 0, _AT_MACHINE), (_JUMP_EQUAL, 1, 0, identity), (_RETURN, 0, 0, _NOT_PERMITTED)]
    steps.append((_LOAD, 0, 0, _AT_NUMBER))
    steps += [(_JUMP_EQUAL, len(numbers) - at, 0, number) for at, number in enumerate(numbers)]
    steps += [(_RETURN, 0, 0, _NOT_PERMITTED), (_RETURN, 0, 0, _ALLOW)]
    code = b"".join(struct.pack("=HBBI", *step) for step in steps)
    program = _Program(len(steps), code)
    return bool(kernel.prctl(_SET_SECCOMP, _FILTER, ctypes.addressof(program), 0, 0) == 0)
