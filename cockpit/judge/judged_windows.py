"""Sums of a run over its windows: stretches, slips, and the checks of sensors, vibration and computer."""

import numpy as np

from bridge.log.check.log_check import LogWatch
from cockpit.judge.machine_terms import MotionOf
from cockpit.judge.margins import MarginSum
from cockpit.judge.pauses import CommandSum, StallSum
from cockpit.judge.phases import Interruptions, PhaseSum, apart
from cockpit.judge.ratio_watch import RatioWatch
from cockpit.judge.sensor_watch import SensorWatch
from cockpit.judge.setup import Described, Setup
from cockpit.judge.slips import Forces, forces_of
from cockpit.judge.watches import FrozenWatch
from cockpit.judge.window import HasMoved, Window
from diagnosis.slips import Cycles


class JudgedWindows:
    """Sums of one run. Each check has `add` for a window, and `result` at the end of the log.

    Args:
        setup, of: numbers of the run, and description of its rig.
        log, frozen: watches of its messages.
        interruptions: interruptions of its controller.
        began_s: begin of its first block.
        stretch_from_s: begin of a further stretch, see `RunJudge`.

    """

    def __init__(
        self,
        setup: Setup,
        of: Described,
        log: LogWatch,
        frozen: FrozenWatch,
        interruptions: Interruptions,
        began_s: float,
        stretch_from_s: float | None,
    ) -> None:
        self._setup, self._interruptions = setup, interruptions
        self._moved, self._motion = HasMoved(), MotionOf()
        self._cycles: list[Cycles] = []
        self._has_force = False  # some block has a force
        self.checked = False  # some window has blocks of a run, not of an imported log
        self.alone = PhaseSum(0.0, np.inf)  # stretches without a controller
        self.phases = {
            "before": PhaseSum(began_s, setup.enabled_from_s),
            "taking_over": PhaseSum(setup.enabled_from_s, setup.settled_from_s),
            "after": PhaseSum(max(setup.settled_from_s, began_s), np.inf),
        }
        if stretch_from_s is not None:
            self.phases["stretch"] = PhaseSum(stretch_from_s, np.inf)
        self.ratio, self.margins = RatioWatch(setup), MarginSum()
        self.commands, self.stalls = CommandSum(log.events, setup.block_s), StallSum(log.events)
        self.sensors = SensorWatch(of, log, frozen, setup.block_s)

    def add(self, window: Window, last_s: float) -> tuple[Window, Forces]:
        """Judge a window of a log read up to `last_s`. Returns the window with its end, and its forces."""
        block_s, is_last = self._setup.block_s, window.is_last
        forces = forces_of(window, self._setup, self._moved)
        window, motion = window._replace(end=forces.end), None
        if not self._setup.imported:
            self.checked = True
            motion = self._motion(window, block_s)
            self.sensors.add(window, forces)
            for check in (self.ratio, self.margins, self.commands, self.stalls):
                check.add(window)
        without = self._interruptions.all(is_last)
        for name, sum_ in self.phases.items():
            sum_.to_s = min(sum_.to_s, last_s) if is_last else sum_.to_s
            sum_.add(forces, motion, without if name in ("taking_over", "after") else [])
        if absences := self._interruptions.gone():
            self.alone.from_s, self.alone.to_s = absences[0][0], absences[-1][1]
            self.alone.add(forces, motion, apart((0.0, np.inf), absences))
        self._cycles.append(forces.cycles)
        self._has_force |= len(forces.t_s) > 0
        return window, forces

    def cycles(self) -> Cycles | None:
        """All slips; None without a force. Then no stretch can be judged either."""
        if not self._has_force or "drive_force_N" in self._setup.absent:
            self.phases, self.alone = {}, PhaseSum(0.0, np.inf)
            return None
        return Cycles(*(np.concatenate(parts) for parts in zip(*self._cycles, strict=True)))
