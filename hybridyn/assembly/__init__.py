"""Assembly: from given motor positions and poses of links to postures that close every loop.

Read `poses` and `requests` (the caller's input, checked), `module_request` (the same for one module), `task`
(the problem that it states), `walk` (steps on one branch), `follow` (from sample to sample), `spanning`,
`assemble`; `chain` holds poses through several modules. `posture` takes a few joints only; `motor_share` and
`free_motions` find motions that motors do not drive.

May import: `structure` and below.
"""
