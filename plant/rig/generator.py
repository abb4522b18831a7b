"""A simulated function generator with command lines, for tests of the adapter `scpi`; it shares no code with it.

It executes one line after the other, each at the end of its answer time, and has the command trees of two makers.
"""

import contextlib
import math
import socket
from typing import Annotated, Literal

from pydantic import Field

from bridge.config import Strict

_UNKNOWN, _IGNORED, _RANGE = '-113,"Undefined header"', '-211,"Trigger ignored"', '-222,"Data out of range"'


class GeneratorConfig(Strict):
    """The table `[generator]` of a box: its exciter is driven by this generator in place of the frames."""

    tree: Literal["agilent", "siglent"] = "agilent"
    port: Annotated[int, Field(ge=0, le=65535)] = Field(0, description="0: any free port, printed at the start.")
    answer_s: Annotated[float, Field(ge=0)] = Field(0.01, description="Time for a line, until its answer.")
    stroke_m_per_V: Annotated[float, Field(gt=0)] = Field(7.8e-8, description="Stroke of the exciter for one volt.")
    highest_Vpp: Annotated[float, Field(gt=0)] = Field(10.0, description="It refuses a larger amplitude.")


class Generator:
    """The generator. Its owner calls `poll` at each block, then reads `vibration`.

    Args:
        config: its table.
        host: address to listen at.

    """

    def __init__(self, config: GeneratorConfig, host: str) -> None:
        self._config = config
        self._server = socket.create_server((host, config.port))
        self._server.setblocking(False)
        self.port = int(self._server.getsockname()[1])
        self._client: socket.socket | None = None
        self._received = b""
        self._lines: list[tuple[float, str]] = []  # with the time at which each is executed
        self._frequency_Hz, self._amplitude_V = 1000.0, 0.05
        self._cycles, self._is_burst, self._is_on = 1, False, False
        self._until_s = -math.inf  # end of the burst
        self._errors: list[str] = []

    @property
    def sockets(self) -> list[socket.socket]:
        """The sockets that wait for bytes."""
        return [self._client or self._server]

    def close(self) -> None:
        """End the connection; the vibration is as before."""
        if self._client is not None:
            self._client.close()
        self._client = None
        self._server.close()

    def vibration(self, now_s: float) -> tuple[float, float]:
        """Frequency [Hz] and amplitude [m] at a time of the box [s]."""
        is_moving = self._is_on and (now_s < self._until_s or not self._is_burst)
        return self._frequency_Hz, self._amplitude_V * self._config.stroke_m_per_V if is_moving else 0.0

    def poll(self, now_s: float, at_once: bool) -> None:
        """Execute the lines that are due; with `at_once` all of them, as no block advances the time."""
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            if self._client is not None:
                self._client.close()
            client.setblocking(False)
            self._client, self._received, self._lines = client, b"", []
        for line in self._new_lines():
            before_s = self._lines[-1][0] if self._lines else now_s
            self._lines.append((max(before_s, now_s) + self._config.answer_s, line))
        while self._lines and (at_once or self._lines[0][0] <= now_s + 1e-9):  # times are sums of blocks
            self._execute(self._lines.pop(0)[1], now_s)

    def _new_lines(self) -> list[str]:
        if self._client is None:
            return []
        try:
            data = self._client.recv(1 << 16)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._client.close()
            self._client = None
            return []
        *lines, self._received = (self._received + data).split(b"\n")
        return [line.decode() for line in lines]

    def _execute(self, line: str, now_s: float) -> None:
        command = self._agilent if self._config.tree == "agilent" else self._siglent
        for part in line.strip().split(";"):
            header, _, value = part.strip().upper().lstrip(":").partition(" ")
            if header.endswith("?"):
                self._answer(header)
            elif header and (error := command(header, value, now_s)):
                self._errors.append(error)

    def _answer(self, query: str) -> None:
        answers = {"*OPC?": "1", "*IDN?": f"box,{self._config.tree},1,1"}
        if query == "SYST:ERR?":
            answers[query] = self._errors.pop(0) if self._errors else '+0,"No error"'
        if query not in answers:
            self._errors.append(_UNKNOWN)
        elif self._client is not None:
            with contextlib.suppress(OSError):
                self._client.sendall(answers[query].encode() + b"\n")

    def _agilent(self, header: str, value: str, now_s: float) -> str:
        match header:
            case "FREQ":
                self._frequency_Hz = float(value)
            case "VOLT" if not 1e-3 <= float(value) <= self._config.highest_Vpp:
                return _RANGE
            case "VOLT":
                self._amplitude_V = float(value) / 2.0
            case "BURS:NCYC":
                self._cycles = int(value)
            case "BURS:STAT":
                self._is_burst = value == "ON"
            case "OUTP":
                self._is_on = value == "ON"
            case "ABOR":
                self._until_s = now_s
            case "*TRG" if now_s < self._until_s:
                return _IGNORED
            case "*TRG":
                self._trigger(now_s)
            case "*CLS":
                self._errors.clear()
            case "FUNC" | "VOLT:UNIT" | "VOLT:OFFS" | "BURS:MODE" | "TRIG:SOUR":
                pass
            case _:
                return _UNKNOWN
        return ""

    def _siglent(self, header: str, value: str, now_s: float) -> str:
        """Commands of key and value pairs; this tree has no error queue."""
        words = value.split(",")
        pairs = dict(zip(words[::2], words[1::2], strict=False))
        match header:
            case "C1:BSWV":
                self._frequency_Hz = float(pairs.get("FRQ", self._frequency_Hz))
                self._amplitude_V = (
                    min(float(pairs.get("AMP", 2.0 * self._amplitude_V)), self._config.highest_Vpp) / 2.0
                )
            case "C1:BTWV" if words == ["MTRIG"]:
                self._trigger(now_s)
            case "C1:BTWV":
                self._is_burst = pairs.get("STATE", "ON" if self._is_burst else "OFF") == "ON"
                self._cycles = int(pairs.get("TIME", self._cycles))
            case "C1:OUTP":
                self._is_on = value == "ON"
            case _:
                return _UNKNOWN
        return ""

    def _trigger(self, now_s: float) -> None:
        self._until_s = now_s + self._cycles / self._frequency_Hz
