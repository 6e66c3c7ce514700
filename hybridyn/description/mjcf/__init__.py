"""Read MJCF, the robot files of MuJoCo, into plain records.

Start with `mjcf` (the order of the steps), then `document` (the file with its includes), `screening` (what
is refused, removed or read before compilation), `compiling` (MuJoCo's compiler, and what is refused of its
model), and the modules that read the compiled model: `bodies`, `relations`.
"""
