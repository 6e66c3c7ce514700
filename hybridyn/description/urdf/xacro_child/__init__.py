"""Expand one xacro file in a child process, which `xacro.py` starts without site-packages.

xacro files are programs and may come from an untrusted source. They are therefore restricted in three ways:
expressions cannot reach Python objects, the kernel locks the process, and the parent opens all files. The
modules in reading order:

    expressions    `${...}` and `$(eval ...)` are evaluated on their syntax trees, without Python's `eval`
    bounds         what expressions may not do, and how large their values may become
    functions      the functions that expressions may call, each with a bound
    kernel_lock    the process permanently loses files, network and programs, if the kernel supports that
    asking         the parent opens files for the child: those in the robot's folders, and no others
    replacing      a faster `replace_node` than xacro's
    main           xacro with all of these restrictions

These modules do not import the rest of the package, which is not on the child's path.
"""
