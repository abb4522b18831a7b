"""Checks from the rig's header, before the first block, that this controller fits the rig."""

import contextlib
import json
import threading
from collections.abc import Callable
from typing import Any

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import refuse_other_schema
from controller.config import ControllerConfig


def refuse_another_rig(header: wire.Header | None, config: ControllerConfig) -> None:
    """Raise Fault if a rig's blocks do not match the controller's configuration.

    BAD_MESSAGE: another schema version; CONFIG: blocks of another length or number of samples. A rig without a header is
    accepted; its blocks are checked as they arrive.
    """
    if header is None:
        return
    refuse_other_schema(header)
    solver: Any = None
    with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError):
        solver = json.loads(header.configuration)["rig"]["solver"]
    if not isinstance(solver, dict):
        return
    for name in ("block_s", "samples_per_block"):
        theirs, ours = solver.get(name), getattr(config, name)
        if isinstance(theirs, int | float) and abs(theirs - ours) > 0.01 * ours:
            line = f"header/plant: rig.solver.{name} = {theirs:g}: must be controller.{name} = {ours:g}"
            raise Fault("CONFIG", f"{line}; set both to the same number")


class RigAgain:
    """Reads the header of a restarted rig in a thread, as the loop must not wait.

    Args:
        ask: requests the rig's header, which may take a second; returns None without an answer.
        config: configuration of the controller.

    """

    def __init__(self, ask: Callable[[], wire.Header | None], config: ControllerConfig) -> None:
        self._ask = ask
        self._config = config
        self._refusal: Fault | None = None

    def begin(self) -> None:
        """Start reading the header; `refuse` reports the result."""
        threading.Thread(target=self._compare, name="rig again", daemon=True).start()

    def refuse(self) -> None:
        """Raise the Fault of `refuse_another_rig` once the header shows it."""
        if self._refusal is not None:
            raise self._refusal

    def _compare(self) -> None:
        try:
            refuse_another_rig(self._ask(), self._config)
        except Fault as fault:
            self._refusal = fault
