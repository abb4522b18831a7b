"""A lockstep run in one process: the same steps and the same log, without a bus. For tests and for many runs."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bridge.arrays import Records
from bridge.guard.events import GuardEvents, changes
from bridge.log.runlog import RunLog
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import seal_all
from bridge.wire.topics import (
    ANNOUNCE,
    APPLIED,
    COMMAND,
    CONTROLLER_EVENT,
    PLANT_EVENT,
    SENSORS,
    SNAPSHOT,
    STATE,
    TRACE,
)
from cockpit.run.closed_loop import ClosedLoop, Stretch
from cockpit.run.device_run import DeviceRun, device_header
from cockpit.run.run_tables import RunTables
from cockpit.run.scenario import Scenario, header
from cockpit.run.step import configurations, loads_of, timed_settings
from controller.node import operator_events
from controller.replay import Change
from controller.telemetry import SNAPSHOT_EVERY, STATE_EVERY, plotted, snapshot
from controller.trips.trip_events import TripEvents
from plant.records import notes
from plant.rig.node import no_number

if TYPE_CHECKING:
    from cockpit.judge.run_judge import RunJudge

# Blocks per call of compiled code and per chunk of the log, 1 MB. A stretch ends where the controller's snapshot is due. If the
# process is killed, at most one stretch is lost, 7 ms of work.
_STRETCH_BLOCKS = SNAPSHOT_EVERY


class TimedAction(NamedTuple):
    """An operator command, a `wire.Operator.Action` or HOLD, at `t_ns`. A stop by file reaches the rig alone."""

    t_ns: int
    action: int
    to_rig: bool = True
    to_controller: bool = True


def run_onboard(
    scenario: Scenario,
    path: Path,
    about: dict[str, Any],
    progress: Callable[[float], None] | None = None,
    changes: Sequence[Change] = (),
    words: Sequence[TimedAction] = (),
    stopped: Callable[[], bool] = lambda: False,
    judge: "RunJudge | None" = None,
) -> None:
    """Run a scenario without faults and write its log; a duration of 0 lasts until `stopped`. Raises Fault LOG_WRITE.

    Args:
        progress: called after every stretch of blocks with the simulated time [s].
        changes, words: changes of the controller's configuration and operator commands, in order of time, in addition
            to the steps of the scenario.
        stopped: called before every stretch of blocks; True ends the run as at its full duration.
        judge: receives every message when it is written; the log is not read back.

    """
    loop = ClosedLoop(scenario.rig, scenario.seed, scenario.controller, scenario.arm)
    loop.warm_up()
    log = log_of(scenario, path, about)
    blocks = round(scenario.duration_s / scenario.rig.solver.block_s) if scenario.duration_s > 0 else 2**62
    if judge is not None:
        judge.begin(log.tables)
    publish = _Events(log, judge)
    publish("plant", 0, "START", "lockstep")
    for code, text in notes(scenario.rig):
        publish("plant", 0, code, text)
    ahead = [*changes, *map(Change._make, configurations(scenario.controller, scenario.step))]
    ahead.sort(key=lambda change: change.t_ns)
    due = sorted([*words, *actions_of(scenario)], key=lambda action: action.t_ns)
    loads = [(round(at_s * 1e9), load) for at_s, load in loads_of(scenario.step)]
    try:
        # the log is compressed and written while the next stretch is computed
        with ThreadPoolExecutor(max_workers=1) as writer:
            written: Future[None] | None = None
            while loop.block < blocks and not stopped():
                while ahead and _first_step(loop, ahead[0].t_ns) <= loop.block:
                    loop.reconfigure(ahead.pop(0).config)
                while loads and _first_step(loop, loads[0][0]) <= loop.block:
                    loop.set_load(loads.pop(0)[1])
                events = 0
                while due and _first_step(loop, due[0].t_ns) <= loop.block:
                    _, action, to_rig, to_controller = due.pop(0)
                    if to_rig:
                        loop.apply_order(action)
                    if to_controller:
                        events = operator_events(events, action)
                # a change of the configuration or an operator command also ends a stretch
                ends = [blocks, (loop.block // _STRETCH_BLOCKS + 1) * _STRETCH_BLOCKS]
                ends += [_first_step(loop, part[0][0]) for part in (ahead, due, loads) if part]
                made = loop.advance(min(ends) - loop.block, events)
                if written is not None:
                    written.result()
                publish.gain_report = loop.gain_report  # after the last stretch was written
                written = writer.submit(
                    _write, log, publish, loop.block, loop.block_ns, made, loop.controller_state.copy()
                )
                if loop.block < min(ends):
                    written.result()
                    _end(publish, loop)
                    raise no_number(scenario.rig, loop.block)
                if progress is not None:
                    progress(loop.block * scenario.rig.solver.block_s)
            if written is not None:
                written.result()
        _end(publish, loop)
    finally:
        log.close()


def actions_of(scenario: RunTables) -> list[TimedAction]:
    """The operator commands among the steps of a scenario, in order of time."""
    steps = [step for step in scenario.step if step.command is not None]
    return [TimedAction(step.t_ns, wire.Operator.Action.Value(step.command or "STOP")) for step in steps]


def _end(publish: "_Events", loop: ClosedLoop) -> None:
    t_ns = loop.block * loop.block_ns
    publish("plant", t_ns, "END", f"blocks={loop.block}")
    publish("controller", t_ns, "END", f"steps={loop.block} duplicates=0 dropped=0")


def log_of(scenario: "Scenario | DeviceRun", path: Path, about: dict[str, Any]) -> RunLog:
    """A new log of a run in one process, with its metadata and headers."""
    log = RunLog(path, lockstep=True, rotation=scenario.log.rotation)
    if settings := timed_settings(scenario.step):
        about = about | {"settings": [*about.get("settings", []), *settings]}
    log.add_metadata("run", about)
    for role in ("controller", "plant"):
        is_simulated = isinstance(scenario, Scenario)
        log.add_header(header(scenario, role, True) if is_simulated else device_header(scenario, role, True))
    return log


def _first_step(loop: ClosedLoop, t_ns: int) -> int:
    """Number of the first block that ends at or after the time of a change or command: it takes effect there."""
    return max(-(-t_ns // loop.block_ns) - 1, 0)


class _Events:
    """Writes the events of rig and controller to the log, as separate processes would publish them."""

    def __init__(self, log: RunLog, judge: "RunJudge | None") -> None:
        self._log, self.judge = log, judge
        self._sequence = {"plant": 0, "controller": 0}
        self.gain_report = ""  # of the last loop check
        self._guard, self._trips = GuardEvents(lambda: self.gain_report), TripEvents()

    def __call__(self, source: str, t_ns: int, code: str, text: str) -> None:
        topic = PLANT_EVENT if source == "plant" else CONTROLLER_EVENT
        event = wire.Event(sequence=self._sequence[source], t_ns=t_ns, source=source, code=code, text=text)
        self._log.write(topic, event.SerializeToString())
        if self.judge is not None:
            self.judge.add_others(topic.name, [event])
        self._sequence[source] += 1

    def of(self, made: Stretch) -> dict[int, list[tuple[str, str, str]]]:
        """Events of guard and controller in a stretch: source, code and text, by the number of the block that each follows."""
        events: dict[int, list[tuple[str, str, str]]] = {}
        for row in changes(made.applied):
            block = int(made.applied["sequence"][row])
            events.setdefault(block, []).extend(("plant", *event) for event in self._guard.news(made.applied[row]))
        for row in changes(made.trace, "reason"):
            block = int(made.applied["sequence"][row])
            events.setdefault(block, []).extend(("controller", *event) for event in self._trips.news(made.trace[row]))
        return {block: news for block, news in events.items() if news}


def _write(log: RunLog, publish: _Events, end: int, block_ns: int, made: Stretch, memory: Records) -> None:
    """Write the messages of a stretch that ends before block `end`, with the state and snapshot messages that are due."""
    begin = end - len(made.trace)
    for row in range(len(made.announce)):
        log.write(ANNOUNCE, made.announce[row : row + 1].tobytes())
    seal_all(made.sensors)
    news = publish.of(made)
    tables = {SENSORS: made.sensors, APPLIED: made.applied, COMMAND: made.command, TRACE: made.trace}
    # a stretch that was cut short begins or ends with an incomplete period of the state message
    periods = min(begin + -begin % STATE_EVERY, end), max(end - end % STATE_EVERY, begin)
    cuts = {begin, *periods, end}
    for block in news:  # an event is written after its block; the parts around it hold whole periods or none
        period = block - block % STATE_EVERY
        cuts |= {max(period, begin), block + 1, min(period + STATE_EVERY, end)}
    for first, last in pairwise(sorted(cuts)):
        part = {topic: table[first - begin : last - begin] for topic, table in tables.items()}
        steps = range(first + STATE_EVERY - first % STATE_EVERY, last + 1, STATE_EVERY)
        states = (
            {STATE: plotted(made.trace[steps[0] - begin - 1 :: STATE_EVERY][: len(steps)], steps[0])} if steps else {}
        )
        log.write_blocks(part, states)
        for source, code, text in news.get(last - 1, ()):
            publish(source, last * block_ns, code, text)
    if end % SNAPSHOT_EVERY == 0 and end > begin:
        log.write(SNAPSHOT, snapshot(memory, end, end * block_ns))
    log.flush()
    if publish.judge is not None:
        for topic, table in tables.items():
            publish.judge.add(topic.name, table, table["t_ns"])
