"""How a process is identified."""

import json
import os

import pytest

from bridge.faults import Fault
from bridge.processes import pid_here, this_process


def test_a_process_is_known_by_its_record() -> None:
    assert pid_here("plant", this_process()) == os.getpid()


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"host": "elsewhere"}, "must be on this computer"),
        ({"started": 1}, "has ended"),
        ({"started": None}, "has ended"),
        ({"pid": 2**22 + 1}, "has ended"),
    ],
)
def test_another_process_is_not_taken_for_it(changed: dict[str, object], line: str) -> None:
    with pytest.raises(Fault, match=line):
        pid_here("plant", json.dumps(json.loads(this_process()) | changed))


@pytest.mark.parametrize("record", ["", "[]", "{}", '{"pid": "x"}'])
def test_an_invalid_record_names_no_process(record: str) -> None:
    with pytest.raises(Fault, match="sends no process identity"):
        pid_here("plant", record)


def test_a_process_of_another_user_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "getuid", lambda: -7)
    with pytest.raises(Fault, match="must be of user -7"):
        pid_here("plant", this_process())
