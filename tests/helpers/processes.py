"""Commands in processes of their own, to be interrupted."""

import os
import signal

import pytest

posix_only = pytest.mark.skipif(os.name != "posix", reason="processes are interrupted and looked at by POSIX signals")


def hears_ctrl_c() -> None:
    """Have a started process heed SIGINT: where the tests themselves run in the background, it would inherit that
    Ctrl-C is ignored. To be given as `preexec_fn`."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
