# ruff: noqa: E501  a table of files has a row for each
"""Small files as other programs write them: ten slips in 4 s. No measured data."""

import json
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

T_S = np.arange(0, 4, 2e-3)
_PHASE = T_S % 0.4
FORCE_N = np.where(_PHASE < 0.37, 8 + 6 * _PHASE / 0.37, 11 + 3 * np.cos(np.pi * (_PHASE - 0.37) / 0.03))
PLACE_MM = 1e3 * 1e-3 * T_S
TOP_N, SLIPS = 14.0, 10


def rows(*columns: Iterable[float], sep: str = ",", end: str = "\n") -> str:
    return "".join(sep.join(f"{value:.6f}" for value in row) + end for row in zip(*columns, strict=True))


class Kind(NamedTuple):
    """A file of a program, the words of the operator, and the force at breakaway in the file's unit."""

    name: str
    text: str
    options: tuple[str, ...] = ()
    top: float = TOP_N
    unit: str = "N"
    encoding: str = "utf-8"


_TWINCAT = "Name\tscope\r\n\r\n\r\nName\tF\tName\tx\r\nSymbolComment\t\t\t\r\nSampleTime[ms]\t2\tSampleTime[ms]\t20\r\nUnit\tN (Force)\tUnit\tmm\r\n\r\n"
_SLOW = [f"{20 * i:g}\t{20e-3 * i:.6f}" if 20 * i < 4000 else " \t " for i in range(len(T_S))]
_STAMPS = [f"10:00:{s:06.3f}" for s in T_S]
KINDS = [
    Kind("twincat.csv", _TWINCAT + "".join(f"{1e3 * t:g}\t{f:.6f}\t{slow}\r\n" for t, f, slow in zip(T_S, FORCE_N, _SLOW, strict=True)), ("--force", "F")),
    Kind("twincat-short-rows.csv", _TWINCAT + "".join(f"{1e3 * t:g}\t{f:.6f}" + (f"\t{slow}\r\n" if slow.strip() else "\r\n") for t, f, slow in zip(T_S, FORCE_N, _SLOW, strict=True))),
    Kind("scope.csv", "X,CH1,Start,Increment,\nSequence,Volt,0.0,2.0e-3\n" + "".join(f"{i},{f / 10:.4f},\n" for i, f in enumerate(FORCE_N)), ("--force", "CH1"), TOP_N / 10, "V"),
    Kind("siglent.csv", "Record Length,Analog:2000\nVertical Scale,CH1: 0.05\nHorizontal Scale, 0.1\nSecond,Volt\n" + rows(T_S - 2, FORCE_N / 10), ("--force", "Volt"), TOP_N / 10, "V"),
    Kind("rohde.csv", "in s,CH1 in V\n" + rows(T_S - 2, FORCE_N / 10), ("--force", "CH1"), TOP_N / 10, "V"),
    Kind("hioki.csv", '"INTERVAL",\n2.000E-03\n"VERT_UNITS", "S", "N"\n"SIGNAL",\n"TIME", "ACH1"\n"DATA"\n' + rows(T_S, FORCE_N), ("--force", "ACH1")),
    Kind("keysight.csv", "x-axis,1,2\nsecond,Volt,Volt\n" + rows(T_S - 2, FORCE_N / 10, PLACE_MM), ("--force", "1"), TOP_N / 10, "V"),
    Kind("plotter.txt", "".join(f"{s} -> F:{f:.3f},x:{x:.4f}\n" for s, f, x in zip(_STAMPS, FORCE_N, PLACE_MM, strict=True)), ("--force", "F")),
    Kind("labels.txt", "".join(f"t={1e3 * t:.0f} ms  F={f:.3f} N\n" for t, f in zip(T_S, FORCE_N, strict=True))),
    Kind("words.log", "Sampling period is 2000000 ns\n" + "".join(f"hm2.force {f:+.9f} pos-fb {x:+.9f}\n" for f, x in zip(FORCE_N, PLACE_MM, strict=True)), ("--force", "hm2.force")),
    Kind("millis.csv", "millis,force_N\n" + "".join(f"{2 * i},{f:.4f}\n" for i, f in enumerate(FORCE_N))),
    Kind("minutes.csv", "time_min,force_N\n" + "".join(f"{t / 60:.9f},{f:.4f}\n" for t, f in zip(T_S, FORCE_N, strict=True))),
    Kind("load-cell.csv", "t [s],loadcell_V\n" + rows(T_S, FORCE_N / 10), (), TOP_N / 10, "V"),
    Kind("overflow.csv", "micros,force_N\n" + "".join(f"{(2**32 - 2_000_000 + 2000 * i) % 2**32},{f:.4f}\n" for i, f in enumerate(FORCE_N))),
    Kind("percent.csv", "time_s,torque_percent,position_mm\n" + rows(T_S, 2 * FORCE_N, PLACE_MM), ("--force", "torque_percent"), 2 * TOP_N, "%"),
    Kind("ampere.csv", "time_s,motor_current_A,position_mm\n" + rows(T_S, FORCE_N / 7, PLACE_MM), (), TOP_N / 7, "A"),
    Kind("pounds.csv", "t [s],torque [lb-ft],angle [deg]\n" + rows(T_S, FORCE_N / 1.3558179483, PLACE_MM), (), TOP_N, "N m"),
    Kind("long.csv", "Timestamp;Name;Value\n" + "".join(f"2026-03-01 10:00:{t:09.6f};F;{f:.5f}\n2026-03-01 10:00:{t:09.6f};x;{x:.6f}\n" for t, f, x in zip(T_S, FORCE_N, PLACE_MM, strict=True)), ("--force", "F")),
    Kind("lines.jsonl", "".join(json.dumps({"t": t, "force_N": f}) + "\n" for t, f in zip(T_S.tolist(), FORCE_N.tolist(), strict=True))),
    Kind("gbk.csv", "时间(s),摩擦力(N),位移(mm)\n" + rows(T_S, FORCE_N, PLACE_MM), ("--force", "摩擦力(N)"), encoding="gb18030"),
    Kind("polish.csv", "Czas [s];Siła tarcia [N]\n" + rows(T_S, FORCE_N, sep=";"), ("--force", "Siła tarcia [N]"), encoding="cp1250"),
    Kind("russian.csv", "Время, с;Сила трения, Н\n" + rows(T_S, FORCE_N, sep=";"), ("--force", "Сила трения, Н"), encoding="cp1251"),
    Kind("sjis.csv", "時間[s],荷重[N]\n" + rows(T_S, FORCE_N), ("--force", "荷重[N]"), encoding="shift_jis"),
]  # fmt: skip
# the programs of a page that `make docs` makes, by the file that is written as they write it
PROGRAMS = {
    "twincat.csv": "TwinCAT Scope (Beckhoff), CSV with a time before each channel",
    "twincat-short-rows.csv": "TwinCAT Scope, where slow channels end sooner",
    "scope.csv": "oscilloscopes of Rigol, CSV with Start and Increment",
    "siglent.csv": "oscilloscopes of Siglent",
    "rohde.csv": "oscilloscopes of Rohde & Schwarz",
    "hioki.csv": "recorders of Hioki",
    "keysight.csv": "oscilloscopes of Keysight and Agilent",
    "plotter.txt": "Arduino: serial monitor with time stamps, serial plotter with labels",
    "labels.txt": "Arduino: lines with labels and units",
    "millis.csv": "Arduino: millis()",
    "overflow.csv": "Arduino: micros(), where the counter overflows",
    "words.log": "LinuxCNC halscope",
    "ampere.csv": "drives: a motor current in A",
    "percent.csv": "drives: a torque in percent",
    "long.csv": "TwinCAT database server, CODESYS, InfluxDB: one value a row",
    "lines.jsonl": "JSON, an object a line",
    "gbk.csv": "programs that write GB 18030",
    "polish.csv": "programs that write Windows-1250",
    "russian.csv": "programs that write Windows-1251",
    "sjis.csv": "programs that write Shift JIS",
}
