"""Shared by all tests."""

from hypothesis import settings

pytest_plugins = ["tests.cpu_limit"]

# the first example compiles kernels, and these machines are shared: time is no criterion in a test
settings.register_profile("stickslip", deadline=None, derandomize=True)
settings.load_profile("stickslip")
