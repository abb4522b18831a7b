"""Check and verdict report a log without a controller, a weak exciter, a wrong clock and wrong definitions."""

from collections.abc import Callable
from pathlib import Path

import pytest

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import EVENTS, SEVERITIES, harms, is_listed
from bridge.wire.messages import NO_BLOCK
from cockpit.judge.judged import judge
from cockpit.judge.verdict_words import headline, in_words
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.logs import Tables, doctored, short_log, tables_of, write

DIED = 300  # block after which the controller is gone


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("long") / "run.mcap"
    run_onboard(load_scenario("from-the-start", ["duration_s=2.0", "rig.drive.stiffness_N_per_m=3e5"]), path, {})
    return path


def changed(path: Path, out: Path, change: Callable[[Tables], None]) -> Path:
    run = read_run(path)
    tables = tables_of(run)
    change(tables)
    write(out, tables, run, 100)
    return out


def controller_dies(tables: Tables) -> None:
    for name in ("command", "trace"):
        tables[name] = tables[name][: DIED * 3]
    applied = tables["applied"]
    applied["command_block"][DIED * 3 :] = DIED * 3 - 1
    applied["fallback"][DIED * 3 + 50 :] = 1


def test_a_controller_that_died_is_reported_and_was_not_in_charge(long_run: Path, tmp_path: Path) -> None:
    path = changed(long_run, tmp_path / "died.mcap", controller_dies)
    verdict = judge(path)
    assert not verdict.good
    assert headline(verdict).startswith("the controller was in charge for 0.95 of 2.00 s only, then it was gone")
    assert verdict.alone is not None
    assert verdict.alone.seconds == pytest.approx(1.05)
    words = "\n".join(in_words(verdict, verbose=True))
    for phrase in ("without a controller", "FALLBACK: ", "CONTROLLER_LOST: ", "UNANSWERED: 1099 blocks of 1999"):
        assert phrase in words
    assert {"fallback", "controller-lost", "unanswered"} <= {finding.kind for finding in check_log(path).findings}


def test_a_sound_run_had_a_controller_in_charge(long_run: Path) -> None:
    verdict = judge(long_run)
    assert verdict.good
    assert (verdict.charge.fallback_s, verdict.charge.unanswered, verdict.charge.alone) == (0.0, 0, False)


def test_a_short_fallback_is_reported_without_a_fault(long_run: Path, tmp_path: Path) -> None:
    def pause(tables: Tables) -> None:
        tables["applied"]["fallback"][500:560] = 1

    verdict = judge(changed(long_run, tmp_path / "pause.mcap", pause))
    assert verdict.good
    assert verdict.charge.longest_fallback_s == pytest.approx(0.06)
    assert "FALLBACK: the rig was without a fresh command for 0.06 s, 1 time, first from 0.50 s on" in verdict.told[0]


def test_the_fade_of_a_stopped_rig_does_not_count_as_fallback(long_run: Path, tmp_path: Path) -> None:
    def stopped(tables: Tables) -> None:
        tables["applied"]["fallback"][-40:] = 1
        tables["applied"]["command_block"][-40:] = NO_BLOCK

    assert judge(changed(long_run, tmp_path / "out.mcap", stopped)).charge.fallbacks == 0


def test_a_rig_that_never_got_a_command_is_reported(long_run: Path, tmp_path: Path) -> None:
    def nobody(tables: Tables) -> None:
        tables["command"] = tables["command"][:0]
        tables["applied"]["fallback"][:] = 1
        tables["applied"]["command_block"][:] = NO_BLOCK

    verdict = judge(changed(long_run, tmp_path / "nobody.mcap", nobody))
    assert not verdict.good
    assert "the controller was in charge for 0.00 of 2.00 s only" in headline(verdict)


def test_a_weak_exciter_is_reported(long_run: Path, tmp_path: Path) -> None:
    def weak(tables: Tables) -> None:
        tables["trace"]["reason"][500:1900] = wire.EXCITER_END

    path = changed(long_run, tmp_path / "weak.mcap", weak)
    verdict = judge(path)
    assert not verdict.good
    assert headline(verdict) == "not ok: EXCITER_END"
    assert any(fault.startswith("EXCITER_END: for 1.40 s: the exciter is at its end") for fault in verdict.faults)
    assert "exciter-end" in {finding.kind for finding in check_log(path).findings}


@pytest.mark.parametrize(
    ("stands", "reported"), [(True, "is constant at "), (False, "jumps at 1 block, first 200 by -3000 ms")]
)
def test_a_clock_that_jumps_or_freezes_is_reported(tmp_path: Path, stands: bool, reported: str) -> None:
    def change(tables: Tables) -> None:
        t_ns = tables["sensors"]["t_ns"]
        t_ns[:] += 3_000_000_000
        t_ns[200:] = t_ns[199] if stands else t_ns[200:] - 3_000_000_000

    path = doctored(tmp_path, change)
    assert any(fault.startswith(f"CLOCK: t_ns of /sensors {reported}") for fault in judge(path).faults)
    assert "clock-jump" in {finding.kind for finding in check_log(path).findings}


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        (b"stickslip.Command", b"stickslip.Applied", "its schema is "),
        (b"\n\x0fstickslip.proto", b"\n\xffstickslip.proto", "its schema "),
        (b"frequency_Hz", b"amplitude_mm", "its schema gives field 4 as 'amplitude_mm': must be 'frequency_Hz'"),
    ],
    ids=["exchanged", "garbage", "renamed"],
)
def test_definitions_that_differ_from_the_messages_are_found(
    tmp_path: Path, old: bytes, new: bytes, reported: str
) -> None:
    path = tmp_path / "run.mcap"
    assert old in short_log()
    path.write_bytes(short_log().replace(old, new))
    assert any(reported in finding.text for finding in check_log(path).findings if finding.kind == "schema")


def test_every_code_has_its_severity_and_place() -> None:
    assert {kind.letter for kind in EVENTS.values()} <= SEVERITIES.keys()
    assert {sender for kind in EVENTS.values() for sender in kind.sources.split(", ")} == {
        "plant",
        "controller",
        "recorder",
    }
    assert EVENTS["CLIPPED"].letter == "F"
    assert "use a larger range" in EVENTS["CLIPPED"].help
    protocol = (Path(__file__).parents[3] / "bridge/wire/PROTOCOL.md").read_text(encoding="utf-8")
    assert not [code for code in EVENTS if f"`{code}`" not in protocol]
    assert (harms("DROPPED"), harms("GAP"), is_listed("GAP"), is_listed("START")) == (True, False, True, False)
    assert is_listed("OF_ANOTHER_VERSION")
    assert not harms("OF_ANOTHER_VERSION")
