"""How tests run and compare: what is made once a session, what is skipped, processes, files, tolerances."""
