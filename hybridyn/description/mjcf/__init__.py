"""Read MJCF, the robot files of MuJoCo, into plain records.

Start with `mjcf` (bodies and joints of the compiled model, and the order of the steps), then `document` (the
file with its includes, and what is refused, removed or read before compilation), `compiling` (MuJoCo's
compiler, and what is refused of its model), and `relations` (equalities and actuators).
"""
