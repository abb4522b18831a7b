"""A function generator with command lines (SCPI), over a TCP socket, or by VISA with the package pyvisa-py.

Each line is a template of the rig file and ends with a query, whose answer acknowledges it. One line is in flight: the newest
order follows once it is acknowledged. The generator makes bursts, which a line begins again before they end, so that silence ends
the vibration. The templates may contain {frequency_Hz}, {amplitude_V}, {amplitude_Vpp}, {offset_V} and {cycles} of a burst.
"""

import contextlib
import importlib
import importlib.util
import math
import socket
import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Annotated, Any, NamedTuple, Protocol

from pydantic import Field, model_validator

from bridge.config import Strict, validate
from bridge.faults import Fault
from bridge.rig.device import DeviceError, Exciter, Setup

# Tried on the simulated generator alone. The first ignores a trigger within a burst, so that the burst is aborted before.
DIALECTS: dict[str, dict[str, Any]] = {
    "agilent-33500": {
        "begin": [
            ":OUTP OFF;*CLS;:FUNC SIN;:VOLT:UNIT VPP;:VOLT:OFFS {offset_V};:SYST:ERR?",
            ":BURS:MODE TRIG;:TRIG:SOUR BUS;:BURS:STAT ON;:SYST:ERR?",
        ],
        "set": ":FREQ {frequency_Hz:.7g};:VOLT {amplitude_Vpp:.5g};:SYST:ERR?",
        "burst": ":FREQ {frequency_Hz:.7g};:VOLT {amplitude_Vpp:.5g};:ABOR;:BURS:NCYC {cycles};:OUTP ON;*TRG;:SYST:ERR?",
        "rest": ":OUTP OFF;:SYST:ERR?",
        "accepted": ["+0,", "0,"],
        "least_V": 5e-4,
    },
    "siglent-sdg": {
        "begin": [
            "C1:OUTP OFF;C1:BSWV WVTP,SINE,OFST,{offset_V};*OPC?",
            "C1:BTWV STATE,ON,GATE_NCYC,NCYC,TRSR,MAN;*OPC?",
        ],
        "set": "C1:BSWV FRQ,{frequency_Hz:.7g},AMP,{amplitude_Vpp:.5g};*OPC?",
        "burst": "C1:BSWV FRQ,{frequency_Hz:.7g},AMP,{amplitude_Vpp:.5g};C1:BTWV TIME,{cycles};C1:OUTP ON;C1:BTWV MTRIG;*OPC?",
        "rest": "C1:OUTP OFF;*OPC?",
        "accepted": ["1"],
        "least_V": 1e-3,
    },
}
_END_S = 1.0  # longest wait for the last line, which brings the exciter to rest
_MOST_BYTES = 4096  # of an answer
_VALUES = {"frequency_Hz": 1.0, "amplitude_V": 1.0, "amplitude_Vpp": 1.0, "offset_V": 0.0, "cycles": 1}


def _is_line(name: str, line: str) -> None:
    try:
        text = line.format(**_VALUES)
    except (LookupError, ValueError) as error:
        known = ", ".join(f"{{{value}}}" for value in _VALUES)
        raise ValueError(f"{name} = {line!r}: cannot be filled in ({error}); use {known}") from None
    if not text.endswith("?"):
        raise ValueError(f"{name} = {line!r}: must end with a query, whose answer acknowledges it; add ;*OPC?")


class ScpiSettings(Strict):
    """The table `[exciter.device]`; a key that is not given is from the dialect."""

    address: str
    dialect: str = ""
    begin: list[str] = []
    set: str
    burst: str = ""  # empty: the generator vibrates until it receives `rest`
    rest: str
    accepted: list[str]  # beginnings of the answers that acknowledge a line
    offset_V: float = 0.0
    least_V: Annotated[float, Field(ge=0)] = 0.0  # a smaller amplitude is rest
    # Length of a burst. Smaller: a line that comes late leaves a gap. Larger: the vibration of a killed process ends later.
    burst_s: Annotated[float, Field(gt=0, le=1.0)] = 0.1
    answer_within_s: Annotated[float, Field(gt=0, le=10.0)] = 1.0

    @model_validator(mode="before")
    @classmethod
    def _with_dialect(cls, table: Any) -> Any:
        name = table.get("dialect", "")
        if name and name not in DIALECTS:
            raise ValueError(
                f"dialect = {name!r}: unknown; known: {', '.join(DIALECTS)}; or give set, rest and accepted"
            )
        return DIALECTS.get(name, {}) | table

    @property
    def is_visa(self) -> bool:
        """Whether `address` is a VISA resource; [::1]:5025 is a socket."""
        return "::" in self.address and not self.address.startswith("[")

    @model_validator(mode="after")
    def _is_whole(self) -> "ScpiSettings":
        lines = [("begin", line) for line in self.begin] + [("set", self.set), ("rest", self.rest)]
        for name, line in [*lines, *([("burst", self.burst)] if self.burst else [])]:
            _is_line(name, line)
        if self.is_visa:
            if importlib.util.find_spec("pyvisa_py") is None:
                line = f"address = {self.address!r}: needs the package pyvisa-py"
                raise ValueError(f"{line}; pip install 'stickslip[visa]', or give HOST:PORT")
        elif not self.address.rpartition(":")[2].isdecimal():
            raise ValueError(f"address = {self.address!r}: must be HOST:PORT, or a VISA resource; add the port")
        return self


class Link(Protocol):
    """A connection for one line at a time. Its methods raise OSError or DeviceError once it is lost."""

    def send(self, line: str) -> None:
        """Send a line."""
        ...

    def answer(self) -> str | None:
        """The answer to the line; None before it has arrived."""
        ...

    def close(self) -> None:
        """Disconnect."""
        ...


class SocketLink:
    """Lines over TCP."""

    def __init__(self, address: str, within_s: float) -> None:
        host, _, port = address.rpartition(":")
        self._socket = socket.create_connection((host.strip("[]"), int(port)), within_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._bytes = b""

    def send(self, line: str) -> None:
        """Send a line."""
        self._socket.sendall(line.encode() + b"\n")

    def answer(self) -> str | None:
        """The answer to the line."""
        with contextlib.suppress(BlockingIOError):
            received = self._socket.recv(_MOST_BYTES)
            if not received:
                raise DeviceError("the generator ended the connection")
            self._bytes = (self._bytes + received)[-_MOST_BYTES:]
        line, ended, rest = self._bytes.partition(b"\n")
        if not ended:
            return None
        self._bytes = rest
        return line.decode(errors="replace")

    def close(self) -> None:
        """Disconnect."""
        self._socket.close()


class VisaLink:
    """Lines by VISA, whose calls wait: a thread makes them."""

    def __init__(self, address: str, within_s: float) -> None:
        visa: Any = importlib.import_module("pyvisa")
        self._manager: Any = visa.ResourceManager("@py")
        try:
            self._resource: Any = self._manager.open_resource(
                address, timeout=round(within_s * 1e3), read_termination="\n", write_termination="\n"
            )
        except Exception as error:
            self._manager.close()
            raise DeviceError(str(error)) from None
        self._thread = ThreadPoolExecutor(1)
        self._answer: Future[str] | None = None

    def send(self, line: str) -> None:
        """Send a line."""
        self._answer = self._thread.submit(self._resource.query, line)

    def answer(self) -> str | None:
        """The answer to the line."""
        if self._answer is None or not self._answer.done():
            return None
        try:
            return str(self._answer.result())
        except Exception as error:  # of the driver, whose classes are known only where it is installed
            raise DeviceError(str(error)) from None

    def close(self) -> None:
        """Disconnect."""
        self._thread.shutdown()
        self._resource.close()
        self._manager.close()


class _Flight(NamedTuple):
    """The line in flight."""

    line: str
    frequency_Hz: float
    amplitude: float
    sent_s: float
    block: int


class Adapter(Exciter):
    """A function generator."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self._settings = validate(ScpiSettings, dict(setup.settings), "exciter.device")
        if not setup.in_volts:
            raise Fault(
                "CONFIG", "exciter.stroke_m_per_V: missing: a generator takes volts; give the stroke for one volt"
            )
        self.watchdog_s = self._settings.burst_s if self._settings.burst else 0.0
        self.slowest_answer_s = self.watchdog_s or self._settings.answer_within_s  # two lines are shorter than a burst
        self._link: Link | None = None
        self._answer_s = 0.0
        self._begin()

    def _begin(self) -> None:
        self._flight: _Flight | None = None
        self._wanted = self._executed = 1.0, 0.0
        self._rests = False  # whether the newest line brought it to rest, acknowledged
        self._refused = ""
        self._block = 0  # counts calls of `write`, one a block
        self._burst_block = 0  # in which the line of the last burst was sent
        self._line_blocks = 0  # that the last line took

    @property
    def answer_s(self) -> float:
        """Time from a line to its answer, of the newest answered one."""
        return self._answer_s

    def open(self) -> None:
        """Connect, and bring the generator into its mode, at rest."""
        self._begin()
        s = self._settings
        try:
            self._link = (VisaLink if s.is_visa else SocketLink)(s.address, s.answer_within_s)
            for line in [*s.begin, s.rest]:
                self._send(line, *self._wanted)
                self._finish(s.answer_within_s)
                if self._refused:
                    raise DeviceError(self._refused)
        except (OSError, OverflowError, DeviceError) as error:
            self._disconnect()
            raise DeviceError(f"{s.address}: {getattr(error, 'strerror', None) or error}") from None

    def _send(self, line: str, frequency_Hz: float, amplitude: float) -> None:
        text = line.format(
            frequency_Hz=frequency_Hz,
            amplitude_V=amplitude,
            amplitude_Vpp=2.0 * amplitude,
            offset_V=self._settings.offset_V,
            cycles=max(math.floor(self._settings.burst_s * frequency_Hz), 1),
        )
        self._rests = False
        self._connected.send(text)
        self._flight = _Flight(text, frequency_Hz, amplitude, time.monotonic(), self._block)

    @property
    def _connected(self) -> Link:
        if self._link is None:
            raise DeviceError("the generator is not connected")
        return self._link

    def _finish(self, within_s: float) -> None:
        """Wait for the answer to the line in flight."""
        until_s = time.monotonic() + within_s
        while not self._is_free() and time.monotonic() < until_s:
            time.sleep(1e-4)

    def _is_free(self) -> bool:
        """Whether no line is in flight, after the answer that may have arrived. Raises DeviceError once the generator is gone."""
        flight = self._flight
        if flight is None:
            return True
        answer, now_s = self._connected.answer(), time.monotonic()
        if answer is None:
            if now_s - flight.sent_s > self._settings.answer_within_s:
                raise DeviceError(f"no answer to {flight.line!r} within {self._settings.answer_within_s:g} s")
            return False
        self._flight, self._answer_s, self._line_blocks = None, now_s - flight.sent_s, self._block - flight.block
        if answer.strip().startswith(tuple(self._settings.accepted)):
            self._executed = flight.frequency_Hz, flight.amplitude
            self._rests = flight.amplitude == 0.0
        else:
            self._wanted = flight.frequency_Hz, 0.0
            self._refused = f"the generator refuses {flight.line!r}: {answer.strip()[:200]!r}"
        return True

    def _go_on(self) -> None:
        """Send the newest order, once the line in flight is acknowledged, where it changes something or a burst ends."""
        try:
            if not self._is_free():
                return
            s, (frequency_Hz, amplitude) = self._settings, self._wanted
            if amplitude == 0.0:
                if not self._rests:
                    self._send(s.rest, frequency_Hz, 0.0)
                return
            # the next line may take as long as the last one, and be the last one before the end of the burst
            until = self._block - self._burst_block + 2 * self._line_blocks
            if s.burst and (self._executed[1] == 0.0 or until * self.block_s >= s.burst_s / 2.0):
                self._burst_block = self._block
                self._send(s.burst, frequency_Hz, amplitude)
            elif self._wanted != self._executed:
                self._send(s.set, frequency_Hz, amplitude)
        except OSError as error:
            raise DeviceError(f"the connection is lost: {error.strerror}") from None

    @property
    def executed(self) -> tuple[float, float]:
        """The vibration of the last acknowledged line."""
        self._go_on()
        return self._executed

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Set the newest order."""
        self._block += 1
        self._wanted = frequency_Hz, amplitude if amplitude >= self._settings.least_V else 0.0
        self._go_on()
        if self._refused:
            refused, self._refused = self._refused, ""
            raise DeviceError(refused)

    def safe(self) -> None:
        """Order rest, as the next line."""
        self._wanted = self._wanted[0], 0.0
        with contextlib.suppress(DeviceError):
            self._go_on()

    def close(self) -> None:
        """Bring the generator to rest and disconnect."""
        with contextlib.suppress(DeviceError, OSError):
            self._finish(_END_S)
            self.safe()
            self._finish(_END_S)
        self._disconnect()

    def _disconnect(self) -> None:
        if self._link is not None:
            self._link.close()
        self._link = None
