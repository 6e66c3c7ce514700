"""hybridyn: dynamics of hybrid robots, exact and linear in the number of modules."""
