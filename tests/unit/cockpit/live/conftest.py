"""A made-up rig, and a view of it."""

import pytest

from cockpit.live.view import View
from tests.unit.cockpit.live.made import Rig


@pytest.fixture
def rig() -> Rig:
    return Rig()


@pytest.fixture
def view(rig: Rig) -> View:
    return View(rig, "tcp/127.0.0.1:7447", rig.clock)
