"""Open USD files in a child process, which `opening.py` starts without site-packages.

OpenUSD is C++ and reads binary files, so a hostile file could end the process or fill its memory. Each file
is therefore opened in a process of its own, with limits of time and memory. The modules in reading order:

    main       a small server: it imports OpenUSD once, and forks for each file
    layers     the layers that a file names are checked before OpenUSD composes them
    dumping    the composed prims as plain data

These modules do not import the rest of the package, which is not on the child's path.
"""
