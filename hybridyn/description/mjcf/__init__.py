"""MJCF, the robot files of MuJoCo, to plain records.

Read `mjcf` (the order of the steps), then `document` (one text of all included files), `screening` (what is
refused and what is left out before MuJoCo sees the text), `compiling` (MuJoCo's own compiler and its model),
then what is taken from the compiled model: `bodies`, `equalities`, `actuators`, `passive`, `keyframes`.
"""
