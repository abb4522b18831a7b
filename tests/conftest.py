"""Shared by all tests."""

import atexit
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator

import pytest
from hypothesis import settings

pytest_plugins = ["tests.cpu_limit", "tests.stall_report"]

# no deadline: the first example compiles kernels, and the computer is shared
settings.register_profile("stickslip", deadline=None, derandomize=True)
settings.load_profile("stickslip")
# A suite that a script starts with `&` inherits an ignored SIGINT, one under `nohup` an ignored SIGHUP, and so would all that the
# tests start; the ends of commands are tested.
# A child does not inherit a handler of Python, and a closed terminal does not end the suite.
signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda _number, _frame: None)
# where rigs leave their passwords and states: a folder that is gone afterwards, with a short name as in a login
os.environ["XDG_RUNTIME_DIR"] = os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="stickslip-tests-")
atexit.register(shutil.rmtree, os.environ["XDG_RUNTIME_DIR"], ignore_errors=True)
_NIGHTLY_S = 3600.0  # a whole diagnosis while other programs run
_REALTIME_S = 180.0  # a process that hangs is reported soon


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
