"""`log check` finds each change of a log, and nothing in a sound log."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from typer.testing import CliRunner

from bridge.faults import Fault
from bridge.log.check.channel import ChannelLimits, channel_findings
from bridge.log.check.log_check import check_log
from bridge.log.check.signal_range import look
from bridge.log.logfile import read_run
from bridge.log.recover import recover
from bridge.log.topic_watch import TopicWatch
from cockpit.commands.log import log_app
from cockpit.judge.judged import judge
from cockpit.judge.verdict_words import in_words
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.logs import Tables, doctored, short_log


def kinds(path: Path) -> dict[str, str]:
    return {finding.kind: f"{finding.where}: {finding.text}" for finding in check_log(path).findings}


def test_a_sound_log_has_no_findings(tmp_path: Path) -> None:
    path = tmp_path / "sound.mcap"
    path.write_bytes(short_log())
    check = check_log(path)
    assert check.findings == []
    assert check.messages["sensors"] == 400
    assert check.seconds == pytest.approx(0.4)
    assert CliRunner().invoke(log_app, ["check", str(path)]).exit_code == 0


def gap(tables: Tables) -> None:
    tables["sensors"] = np.delete(tables["sensors"], slice(100, 103))


def twice(tables: Tables) -> None:
    tables["command"] = np.insert(tables["command"], 50, tables["command"][50])


def late_command(tables: Tables) -> None:
    order = np.arange(400)
    order[[200, 202]] = [202, 200]
    tables["sensors"] = tables["sensors"][order]


def two_runs(tables: Tables) -> None:
    for name, table in tables.items():
        tables[name] = np.concatenate([table, table])


def clipped(tables: Tables) -> None:
    force_N = tables["sensors"]["drive_force_N"]
    np.minimum(force_N, 0.5 * force_N.max(), out=force_N)


def at_range(tables: Tables) -> None:
    tables["sensors"]["mass_accel_mps2"][300, 3] = 490.3325


def dead(tables: Tables) -> None:
    tables["sensors"]["base_accel_mps2"][:] = 0.25


def not_finite(tables: Tables) -> None:
    tables["sensors"]["mass_accel_mps2"][10, 5] = np.nan
    tables["sensors"]["mass_accel_mps2"][10, 6] = np.inf


def clock_jumps(tables: Tables) -> None:
    tables["sensors"]["t_ns"][200:] += 5_000_000


def clock_goes_back(tables: Tables) -> None:
    tables["trace"]["t_ns"][200:] -= 50_000_000


def late(tables: Tables) -> None:
    tables["applied"]["late_ns"][:40] = 1_500_000


def begins_late(tables: Tables) -> None:
    tables["sensors"] = tables["sensors"][7:]


@pytest.mark.parametrize(
    ("change", "kind", "text"),
    [
        (gap, "gap", "/sensors: 3 messages lost: 100 to 102"),
        (begins_late, "gap", "begins with block 7"),
        (twice, "duplicate", "/command: repeated numbers at 1 place, first 50"),
        (late_command, "order", "/sensors: 2 messages arrived after a later message"),
        (two_runs, "two-runs", "numbers start again at 0 after"),
        (clipped, "clipped", "/sensors drive_force_N: "),
        (at_range, "clipped", "/sensors mass_accel_mps2: reaches the end of its range, 490.33"),
        (dead, "dead", "/sensors base_accel_mps2: constant at 0.25"),
        (not_finite, "not-finite", "/sensors mass_accel_mps2: 2 samples are no finite number, first after 0.010 s"),
        (clock_jumps, "clock-jump", "/sensors: t_ns does not follow the numbers at 1 place, first 200"),
        (clock_goes_back, "clock-jump", "/trace: t_ns does not follow the numbers at 1 place, first 200"),
        (clock_goes_back, "log-time-back", "/trace: log_time goes back at 1 place, first 200: by 49 ms"),
        (late, "late", "/applied: 10.0 % of the messages were later than 1 ms"),
    ],
)
@pytest.mark.slow
def test_each_change_is_found(tmp_path: Path, change: Callable[[Tables], None], kind: str, text: str) -> None:
    path = doctored(tmp_path, change)
    assert text in kinds(path)[kind]
    result = CliRunner().invoke(log_app, ["check", str(path), "--json"])
    assert result.exit_code == 1
    assert kind in {finding["kind"] for finding in json.loads(result.stdout)["findings"]}


def test_noise_alone_and_a_coarse_position_at_rest_give_no_finding() -> None:
    """Both repeat values: noise of a few steps its largest value, and a position that rests within a step."""
    noise = np.clip(np.random.default_rng(1).standard_normal(100_000), -3.5, 3.5)
    accel_mps2 = (0.001 * np.round(1.5 * noise)).astype(np.float32)
    accel = ChannelLimits(noise=0.0015, step=0.001, low=-490.0, high=490.0)
    assert look(accel_mps2, dwells=False).at_highest > 20
    assert channel_findings("base_accel_mps2", look(accel_mps2, dwells=False), 5e-5, accel) == []
    position_m = 1e-6 * np.arange(3.0).repeat(40_000)
    position = ChannelLimits(noise=1e-8, step=1e-6, low=-1.0, high=1.0)
    assert channel_findings("mass_position_m", look(position_m, dwells=True), 5e-5, position) == []


def test_the_lower_end_of_a_range_is_known(tmp_path: Path) -> None:
    """A return stroke pushes beyond -8 N: a sensor that ends at -8 N is clipped, one that ends at -50 N is not."""
    back = ["duration_s=0.4", "rig.drive.profile=[[0.0, -0.01]]", "rig.sensors.position_lowest_m=-0.01"]
    for lowest_N, reported in ((-8.0, "clipped"), (-50.0, None)):
        scenario = load_scenario("from-the-start", [*back, "rig.sensors.force_lowest_N=-50.0"])
        sensors = scenario.rig.sensors.model_copy(update={"force_lowest_N": lowest_N})  # a file with -8 N is refused
        scenario = scenario.model_copy(update={"rig": scenario.rig.model_copy(update={"sensors": sensors})})
        path = tmp_path / f"{-lowest_N:g}.mcap"
        run_onboard(scenario, path, {})
        assert kinds(path).get("clipped", "").startswith("/sensors drive_force_N" if reported else "")
        assert ("clipped" in kinds(path)) == (reported is not None)


def test_a_late_message_closes_its_gap(tmp_path: Path) -> None:
    def change(tables: Tables) -> None:
        tables["sensors"] = tables["sensors"][[*range(2), 3, 2, 4, *range(6, 400)]]

    reported = kinds(doctored(tmp_path, change))
    assert "/sensors: 1 message lost: 5" in reported["gap"]
    assert "order" in reported


def test_missing_messages_are_counted_in_whatever_order_the_others_came() -> None:
    """Stretches that come late, the first ones among them, and doubled messages, in pieces of any length."""
    drawn = np.random.default_rng(1)
    for _ in range(300):
        numbers = drawn.integers(0, 50) + np.flatnonzero(drawn.random(200) > 0.2 * drawn.random())
        for _ in range(drawn.integers(0, 4)):
            first, middle, end = np.sort(drawn.integers(0, len(numbers), 3))
            parts = numbers[:first], numbers[middle:end], numbers[first:middle], numbers[end:]
            numbers = np.concatenate([*parts, numbers[first : first + 1]])
        watch = TopicWatch("sensors")
        for piece in np.split(numbers, np.sort(drawn.integers(0, len(numbers), 3))):
            records = np.zeros(len(piece), [("sequence", "u8"), ("t_ns", "i8")])
            records["sequence"] = piece
            watch.add(records, records["t_ns"], 0.0)
        whole = range(int(numbers.min()), int(numbers.max()) + 1)
        assert (watch.first_number, watch.end) == (whole.start, whole.stop)
        assert watch.missing == len(whole) - len(set(numbers.tolist()))


def test_a_cut_log(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(short_log()[:-4000])
    assert "stickslip log recover" in kinds(path)["cut"]


def test_a_log_with_a_damaged_chunk(tmp_path: Path) -> None:
    data = bytearray(short_log())
    data[data.index(b"zstd", len(data) // 2) + 100] ^= 0x40
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    assert {"damaged", "gap"} <= kinds(path).keys()


def test_no_log_is_a_fault(tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").touch()
    with (tmp_path / "foreign.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/String", "ros2msg", b"string data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        writer.add_message(channel, 1, b"hello", 1)
        writer.finish()
    version = (tmp_path / "version.mcap", short_log().replace(b"stickslip schema 3", b"stickslip schema 4"))
    version[0].write_bytes(version[1])
    (tmp_path / "text.mcap").write_text("t_s,drive_force_N\n" * 100)
    (tmp_path / "folder.mcap").mkdir()
    expected = {
        "empty": "0 bytes, no MCAP file",
        "foreign": "holds no topic of a run: its messages are std_msgs/String; give a run log",
        "version": "written by 'stickslip schema 4'",
        "text": "no MCAP file",
        "folder": "is a folder, must be a file; ",
        "absent": "no such file; ",
        "long" * 70: "cannot be read: File name too long; ",
    }
    for name, line in expected.items():
        path = tmp_path / f"{name}.mcap"
        for use in (check_log, read_run):
            with pytest.raises(Fault) as caught:
                use(path)
            assert caught.value.kind.code == "BAD_LOG"
            assert line in caught.value.line
        for command in ("check", "info", "recover"):
            assert CliRunner().invoke(log_app, [command, str(path)]).exit_code == 7
        export = ["export", str(path), "--to", str(tmp_path / "out.csv")]
        assert CliRunner().invoke(log_app, export).exit_code == 7


def test_the_verdict_on_a_cut_log_reports_the_loss(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(short_log()[: len(short_log()) * 2 // 3])
    result = CliRunner().invoke(log_app, ["info", str(path), "--json"])
    verdict = json.loads(result.stdout)
    assert (result.exit_code, verdict["good"], verdict["control"]) == (14, False, "not judged")
    assert "after its last whole record cannot be read" in " ".join(verdict["faults"])
    assert verdict["all_losses_known"] is False


@pytest.mark.parametrize(("chunk", "lost", "known"), [(0, 40, True), (4, 40, True), (9, 40, True), (-1, 0, False)])
def test_the_verdict_counts_the_blocks_of_a_damaged_chunk(tmp_path: Path, chunk: int, lost: int, known: bool) -> None:
    """The last of all chunks holds no block, but the plant's END."""
    data, path = bytearray(short_log()), tmp_path / "flipped.mcap"
    path.write_bytes(data)
    with path.open("rb") as file:
        start = make_reader(file).get_summary().chunk_indexes[chunk].chunk_start_offset
    data[start + 60] ^= 0x40
    path.write_bytes(data)
    verdict = judge(path)
    assert (verdict.lost_blocks, verdict.all_losses_known) == (lost, known)
    expected = (
        f"{lost} of 400 blocks missing in the log" if known else "400 blocks; the number of missing blocks is unknown"
    )
    assert f"data     {expected}" in "\n".join(in_words(verdict, verbose=False))


def test_a_recovered_log_reports_the_loss(tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(short_log()[: len(short_log()) * 2 // 3])
    for path, out in ((cut, tmp_path / "saved.mcap"), (tmp_path / "saved.mcap", tmp_path / "again.mcap")):
        recover(path, out)
        assert "cut.mcap: " in kinds(out)["recovered"]
        assert "at the end" in kinds(out)["recovered"]
        assert judge(out).all_losses_known is False
