"""What is wrong is told at once, then once a second for each kind, and nothing is left uncounted."""

from bridge.wire.complaints import Complaints


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def complaints() -> tuple[Complaints, list[tuple[str, str]], Clock]:
    told: list[tuple[str, str]] = []
    clock = Clock()
    return Complaints(lambda code, text: told.append((code, text)), clock), told, clock


def test_a_flood_is_told_once_a_second_with_its_count() -> None:
    made, told, clock = complaints()
    for _ in range(3000):
        made.note("BAD_MESSAGE", "command", "12 bytes: dropped")
        clock.now_s += 0.001
        made.report_when_due()
    made.report_when_due(all_of_it=True)
    assert len(told) in {4, 5}
    assert told[0] == ("BAD_MESSAGE", "command: 12 bytes: dropped")
    assert told[-1][1].endswith("3000 in all)")
    assert sum(int(text.partition("(")[2].partition(" ")[0] or 1) for _, text in told) == 3000


def test_kinds_do_not_wait_for_each_other() -> None:
    made, told, _ = complaints()
    for code, where in (("FOREIGN", "command"), ("FOREIGN", "sensors"), ("CLOCK", "sensors"), ("CLOCK", "sensors")):
        made.note(code, where, "x", 2)
    assert told == [
        ("FOREIGN", "command: x (2 times)"),
        ("FOREIGN", "sensors: x (2 times)"),
        ("CLOCK", "sensors: x (2 times)"),
    ]


def test_what_was_kept_back_is_told_without_another_of_its_kind() -> None:
    made, told, clock = complaints()
    made.note("FLOOD", "operator", "dropped")
    made.note("FLOOD", "operator", "dropped", 5)
    made.report_when_due()
    assert len(told) == 1
    clock.now_s += 1.1
    made.report_when_due()
    made.report_when_due()
    made.report_when_due(all_of_it=True)
    assert told[1:] == [("FLOOD", "operator: dropped (5 times, 6 in all)")]
