"""What all tests share: one thread per solver, and properties that do not depend on the machine's mood."""

import os

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")  # before numpy: tests run side by side already

from hypothesis import HealthCheck, settings  # noqa: E402

# Deadlines measure the machine, not the code.
settings.register_profile("tests", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")
