"""A problem is reported at once, then once a second for each kind, with the count of all."""

from bridge.wire.clock import time
from bridge.wire.complaints import Complaints


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def complaints() -> tuple[Complaints, list[tuple[str, str]], Clock]:
    reported: list[tuple[str, str]] = []
    clock = Clock()
    return Complaints(lambda code, text: reported.append((code, text)), clock), reported, clock


def test_a_flood_is_reported_once_a_second_with_its_count() -> None:
    made, reported, clock = complaints()
    for _ in range(3000):
        made.note("BAD_MESSAGE", "command", "12 bytes: dropped")
        clock.now_s += 0.001
        made.report_when_due()
    made.report_when_due(all_of_it=True)
    assert len(reported) in {4, 5}
    assert reported[0] == ("BAD_MESSAGE", "command: 12 bytes: dropped")
    assert reported[-1][1].endswith("3000 in all)")
    assert sum(int(text.partition("(")[2].partition(" ")[0] or 1) for _, text in reported) == 3000


def test_kinds_do_not_wait_for_each_other() -> None:
    made, reported, _ = complaints()
    for code, where in (("FOREIGN", "command"), ("FOREIGN", "sensors"), ("CLOCK", "sensors"), ("CLOCK", "sensors")):
        made.note(code, where, "x", 2)
    assert reported == [
        ("FOREIGN", "command: x (2 times)"),
        ("FOREIGN", "sensors: x (2 times)"),
        ("CLOCK", "sensors: x (2 times)"),
    ]


def test_held_back_complaints_are_reported_without_another_of_their_kind() -> None:
    made, reported, clock = complaints()
    made.note("FLOOD", "operator", "dropped")
    made.note("FLOOD", "operator", "dropped", 5)
    made.report_when_due()
    assert len(reported) == 1
    clock.now_s += 1.1
    made.report_when_due()
    made.report_when_due()
    made.report_when_due(all_of_it=True)
    assert reported[1:] == [("FLOOD", "operator: dropped (5 times, 6 in all)")]


def test_simulated_time_that_begins_later_counts() -> None:
    """Rig and controller are made before it: with the computer's seconds a log depended on the speed of its run."""
    reported: list[str] = []
    made, now_ns = Complaints(lambda _, text: reported.append(text)), 0
    with time.simulated(lambda: now_ns, lambda _: None):
        made.note("FOREIGN", "command", "x")
        made.note("FOREIGN", "command", "x")
        assert len(reported) == 1
        now_ns = 1_000_000_000
        made.report_when_due()
    assert len(reported) == 2
