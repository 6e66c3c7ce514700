"""Write URDF, with closures and couplings in hybridyn's own elements, and the files beside it."""
