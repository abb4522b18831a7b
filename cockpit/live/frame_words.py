"""A rig's state at one instant, line by line: the screen of `watch`, and `status`."""

from collections.abc import Mapping, Sequence
from typing import Any

from bridge.units import counted, quantity
from cockpit.figures.signals import WORD_SIGNALS, WordSignal
from cockpit.live.listener import ROLES
from cockpit.live.view import LIVE, EventRow, plain_help

_UNKNOWN = "-"
_NEXT = {
    "FAULT": "no vibration until `stickslip reset`, then `stickslip arm`",
    "DISARMED": "no vibration until `stickslip arm`",
    "NO_GUARD": "no guard limits the vibration on the rig's side",
}  # next command by state of the guard
_NAMES = 9  # width of the names in `status`


def frame_lines(now: Mapping[str, Any], events: Sequence[EventRow]) -> list[str]:
    """The lines of `status`: the answer, a line for each row, the events, and the next commands."""
    named = [("answer", now["answer"]["text"]), *rows(now), *(("event", event_line(event)) for event in events)]
    named += [("next", text) for state, text in _NEXT.items() if state == now.get("guard_state")]
    return [f"{name:<{_NAMES}}{words}" for name, words in named]


def event_line(event: EventRow) -> str:
    """An event with its severity."""
    severity = f" ({event.weight})" if event.letter else ""
    return f"{event.t_s:9.3f} s  {event.source:<10} {event.code}{severity}: {event.text}"


def rows(now: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and text of each line; dashes for unknown values."""
    live, roles = now["phase"] == LIVE, now["roles"]

    def number(name: str, form: str) -> str:
        return _UNKNOWN if now.get(name) is None else format(now[name], form)

    def figure(name: str, unit: str) -> str:
        return _UNKNOWN if now.get(name) is None else quantity(now[name], unit)

    def word(signal: WordSignal) -> str:
        value = now.get(signal.field)
        return f"{value}: {plain_help(signal.column, value)}" if value else _UNKNOWN

    slips = "no controller counts slips"
    if now["slips_of_late"] is not None:
        slips = counted(now["slips"], "slip")
    if (now["slips_over_s"] or 0.0) >= 1.0:
        slips += f", {now['slips_of_late']} in the last {now['slips_over_s']:.0f} s"
    breaks = f", breaks away at {now['breakaway_force_N']:.2f} N" if now.get("breakaway_force_N") else ""
    forecast = "no slip expected" if now.get("time_to_slip_s") is None else f"slip in {now['time_to_slip_s']:.2f} s"
    missing = "".join(f"; no {role}" for role in ROLES if role not in roles)
    return [
        *([("warning", now["other_rig"])] if now["other_rig"] else []),
        ("rig", f"{now['rig'] or 'of unknown name'} at {now['endpoint']}" if "plant" in roles else _UNKNOWN),
        ("on bus", (", ".join(role for role in ROLES if role in roles) or "no process") + missing),
        ("run", f"{now['t_s']:.1f} s, {slips}" if live else _UNKNOWN),
        *((signal.title, word(signal)) for signal in WORD_SIGNALS),
        ("force", f"{number('drive_force_N', '.2f')} N{breaks}"),
        ("v_a/v_d", f"{number('velocity_ratio', '.2f')}: v_a {figure('vibration_velocity_mps', 'm/s')}, v_d "
                    f"{figure('drive_velocity_mps', 'm/s')}, set point {figure('wanted_velocity_mps', 'm/s')}"),
        ("applied", _applied(now)),
        ("forecast", forecast if now.get("mode") else _UNKNOWN),
        ("commands", _latency(now) if live else _UNKNOWN),
        *([("samples", f"{now['sample_rate_Hz']:.1f} a second, measured")] if now.get("sample_rate_Hz") else []),
        ("lost", _lost(now["lost"])),
    ]  # fmt: skip


def _applied(now: Mapping[str, Any]) -> str:
    if not now.get("amplitude_m"):
        return _UNKNOWN if now.get("amplitude_m") is None else "no vibration"
    stroke_m = min((limit["value"] for limit in now["limits"]), default=None)
    of = f" of {quantity(stroke_m, 'm')}" if stroke_m is not None else ""
    return f"{quantity(now['amplitude_m'], 'm')}{of} at {now['frequency_Hz'] or 0.0:.0f} Hz"


def _latency(now: Mapping[str, Any]) -> str:
    lost, late = now["lost"], now["late_us"]
    if late["p50"] is None:
        return _UNKNOWN
    share = 100.0 * lost["late"] / max(lost["commands"], 1)
    answer = f"; the exciter answers in {now['answer_ns'] * 1e-3:.0f} us" if now.get("answer_ns") else ""
    return f"half within {late['p50']:.0f} us, 99 % within {late['p99']:.0f} us, {share:.2f} % later than 1 ms{answer}"


def _lost(lost: Mapping[str, int] | None) -> str:
    if lost is None:
        return _UNKNOWN
    return (
        f"{counted(lost['controller'], 'block')} to the controller, {counted(lost['viewer'], 'block')} to this screen; "
        f"{counted(lost['dropped'], 'message')} dropped by it"
    )
