"""Shared by all tests."""

import atexit
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator

import pytest
from hypothesis import settings

pytest_plugins = ["tests.cpu_limit"]

# the first example compiles kernels, and these machines are shared: time is no criterion in a test
settings.register_profile("stickslip", deadline=None, derandomize=True)
settings.load_profile("stickslip")
# a suite that a script starts with `&` inherits an ignored SIGINT, and so would all that the tests start: Ctrl-C is tested
signal.signal(signal.SIGINT, signal.default_int_handler)
# where rigs leave their passwords: a folder that is gone afterwards, with a short name as in a login
os.environ["XDG_RUNTIME_DIR"] = tempfile.mkdtemp(prefix="stickslip-tests-")
atexit.register(shutil.rmtree, os.environ["XDG_RUNTIME_DIR"], ignore_errors=True)
_NIGHTLY_S = 1800.0  # a whole diagnosis beside other work
_REALTIME_S = 120.0  # nobody waits longer for a process: one that hangs is known soon


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.get_closest_marker("realtime"):
            item.add_marker(pytest.mark.timeout(_REALTIME_S))
        elif item.get_closest_marker("nightly") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(_NIGHTLY_S))


@pytest.fixture(autouse=True)
def endings() -> Iterator[None]:
    """A command that runs within a test leaves its handlers of Ctrl-C behind, as its process would end now."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
