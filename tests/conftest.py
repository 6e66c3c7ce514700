"""Settings that must stand before numpy is imported."""

import os

# The matrices of the tests are small: threads of BLAS gain nothing, and two pytest workers fight over cores.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
