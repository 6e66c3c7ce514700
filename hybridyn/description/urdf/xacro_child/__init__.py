"""The child process that expands one xacro file, started by `xacro_files.py` with no site-packages.

xacro files are programs, and may come from anywhere. Three walls stand around them, in reading order:

    expressions    `${...}` and `$(eval ...)` are evaluated on their syntax trees, without Python's `eval`
    functions      the functions that expressions may call, each with a bound
    kernel_lock    the process gives up files, network and programs for good, where the kernel offers that
    asking         so the parent opens the files: those in the robot's folders, and no others
    replacing      a faster `replace_node` than xacro's
    main           xacro with all of this in place

Nothing here imports the rest of the package, which is not on the child's path.
"""
