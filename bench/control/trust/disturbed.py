"""The paper's rig with a sagging exciter, missing commands, and late or held blocks: in simulated time, judged by its truth."""

from typing import Any, NamedTuple

import numpy as np

from bench.control import record, rules
from bench.control.run import wrong_from
from bench.control.watch import watch
from bench.faults.judge import happened, reports
from bench.faults.truth import TruthRun
from bridge.wire.messages import BLOCK
from bridge.wire.messages import TRACE as TRACE_LAYOUT
from bridge.wire.topics import COMMAND, Outgoing
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.scenario_file import in_toml
from controller.config import ControllerConfig
from controller.node import ControllerNode
from plant.config import RigConfig
from plant.rig.node import PlantNode

_BEGIN_S = 2.5  # begin of the judged time; the loop check ends at 1.8 s
_WATCH_S = 10.0  # time from the begin of the disturbance that is judged
_PATTERNS_S = {"once": [1.0], "each-1-s": [1.0 + i for i in range(8)], "each-3-s": [1.0, 4.0, 7.0]}
_INTERRUPTIONS = (
    ("gap", "cut", "commands", (30, 67, 80, 120)),
    ("held", "held", "blocks", (30, 67, 100)),
    ("lost", "cut", "blocks", (100,)),
)
# codes of reports that are true of each disturbance; an exciter of 40 % is at the end of its stroke
_TRUE = {
    "sag": {"EXCITER_END"},
    "gap": {"FALLBACK", "COMMAND_LOST", "STALE", "LATE"},
    "late": {"FALLBACK", "COMMAND_LOST", "STALE", "LATE", "PAUSED"},
    "held": {"FALLBACK", "COMMAND_LOST", "STALE", "LATE", "PAUSED", "FLOOD"},
    "lost": {"FALLBACK", "COMMAND_LOST", "STALE", "LATE", "PAUSED", "GAP"},
}


class Disturbance(NamedTuple):
    """One disturbed run."""

    name: str
    about: str  # kind of the disturbance, a key of `_TRUE`
    scenario: Scenario


def disturbances() -> list[Disturbance]:
    """All disturbed runs. Raises Fault CONFIG."""

    def made(name: str, about: str, watch_s: float, *settings: str) -> Disturbance:
        arms = ["arm=false", 'step=[{at_s = 0.02, command = "ARM"}]', f"duration_s={_BEGIN_S + watch_s}"]
        return Disturbance(name, about, load_scenario("from-the-start", [*arms, *settings]))

    sag = 'rig.effects.piezo-sag={form="heat",ratio=0.6,settling_s='
    entries = [made(f"sag-{tau_s:g}-s", "sag", 20.0, f"{sag}{tau_s}}}") for tau_s in (1.0, 3.0)]
    for about, kind, target, lengths_ms in _INTERRUPTIONS:
        for ms in lengths_ms:
            for pattern, at in _PATTERNS_S.items():
                faults = [
                    {"kind": kind, "target": target, "from_s": _BEGIN_S + at_s, "for_s": 1e-3 * ms} for at_s in at
                ]
                entries.append(made(f"{about}-{ms}-ms-{pattern}", about, _WATCH_S, f"fault={in_toml(faults)}"))
    for ms in (30, 48, 100):
        late = [{"kind": "late", "target": "blocks", "from_s": _BEGIN_S + 1.0, "value": 1e-3 * ms}]
        entries.append(made(f"late-{ms}-ms", "late", _WATCH_S, f"fault={in_toml(late)}"))
    return entries


def disturbed_figures(entry: Disturbance, rule: int) -> tuple[dict[str, float], list[str]]:
    """Slips, surges and v_a over its set point from the disturbance on, and the false reports."""
    run = _Run(entry.scenario, rule)
    ran = happened(run, _BEGIN_S)
    wrong = int(wrong_from(run.events, _BEGIN_S).sum())
    figures = {"wrong": wrong, "above_s": ran.above_s, "peak_set_points": ran.peak_ratio}
    words = reports(ran.record, _BEGIN_S) if rule == rules.CONTROLLER else []
    return figures, [word for word in words if word not in _TRUE[entry.about]]


class _Run(TruthRun):
    """A disturbed run of the controller or a rule, whose true motion is judged block by block."""

    def __init__(self, scenario: Scenario, rule: int) -> None:
        TruthRun.__init__(self, scenario)
        self._rule, self._rig, self._config = rule, scenario.rig, scenario.controller
        slowest_mps = min(scenario.rig.drive.speeds_mps())
        self._judge = record.build(scenario.rig, slowest_mps, 0.0, scenario.controller.limits.velocity_max_mps, -1)
        self._trace = TRACE_LAYOUT.blank()
        self._room = np.empty((64, record.EVENT_COLUMNS))
        self._row = np.empty((1, len(record.BLOCK_ROWS)), np.float32)
        self._events: list[Any] = []

    @property
    def events(self) -> np.ndarray:
        """Events of the true motion; columns as in `bench.control.record`."""
        return np.concatenate([self._room[:0], *self._events])

    def controller_node(self) -> ControllerNode:
        """The controller, or the rule in its place."""
        return _RuleNode(self._config, self._rig) if self._rule != rules.CONTROLLER else ControllerNode(self._config)

    def observe(self, node: PlantNode) -> None:
        """Judge the motion of the last block; the trace is empty, so announcements do not count."""
        v_a_mps, frequency_Hz = np.array([node.vibration_mps]), np.array([float(node.applied["frequency_Hz"])])
        gain = np.ones(1)
        count = watch(*self._judge, node.truth[None], v_a_mps, frequency_Hz, gain, self._trace, self._room, self._row)
        self._events.append(self._room[:count].copy())


class _RuleNode(ControllerNode):
    """The rule "1.2 v_d while it moves" on the controller's messages; without blocks it commands nothing."""

    def __init__(self, config: ControllerConfig, rig: RigConfig) -> None:
        ControllerNode.__init__(self, config)
        forbidden_Hz = [(float(low), float(high)) for low, high in config.limits.forbidden_Hz]
        candidates_Hz = rules.frequencies_Hz(rig, forbidden_Hz)
        self._rule = rules.build(rules.MOVING, rig, 0.0, config.limits.velocity_max_mps, candidates_Hz)

    def _step(self, sensors: Any, events: int, gap_blocks: int) -> Outgoing:  # noqa: ARG002
        if events & BLOCK:
            rules.step(*self._rule, sensors, self.t_ns, 0.0, 0.0, self._command, self._trace)
        else:
            self._command["amplitude_m"] = 0.0
        self.steps += 1
        return Outgoing(COMMAND, self._command.tobytes())
