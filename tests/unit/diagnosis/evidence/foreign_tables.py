"""Small tables as other programs write them: 2 s of a saw-tooth force at 500 Hz, a position that creeps. No measured data."""

# ruff: noqa: E501 - a file a line
import datetime as dt
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
import xlsxwriter
from mcap_ros2.writer import Writer
from nptdms import ChannelObject, TdmsWriter

T = np.arange(0, 2, 1 / 500)
FORCE = np.round(8 + 6 * ((T % 0.4) / 0.4) + 0.02 * np.random.default_rng(0).standard_normal(len(T)), 5)
POSITION = np.round(1e-3 * T, 8)
_START = dt.datetime(2026, 3, 1, 23, 59, 59)  # noqa: DTZ001
_STAMPS = [(_START + dt.timedelta(seconds=float(s))).isoformat(timespec="microseconds") for s in T]


class Kind(NamedTuple):
    """A file, the columns of time, force and position in it ("": none), and which rows the import keeps."""

    file: str
    content: str | bytes | Callable[[Path], Any]
    columns: tuple[str, str, str]
    rows: slice = slice(0, 1000)
    force_too: float = 1.0  # factor from the force in the file to N
    says: str = ""  # expected part of a finding


def rows(*columns: Any, sep: str = ",", end: str = "\n", form: str = "{:.6f}") -> str:
    """Rows of numbers."""
    return "".join(
        sep.join(form.format(v) if not isinstance(v, str) else v for v in row) + end
        for row in zip(*columns, strict=True)
    )


def german(text: str) -> str:
    """With a decimal comma."""
    return text.replace(".", ",")


def _grouped(value: float) -> str:
    return f"{value:,.3f}".translate(str.maketrans(",.", ".,"))


def _tdms(**properties: dict[str, Any]) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        values = {"Force": FORCE, "Position": POSITION, "Temperature": FORCE[::500]}
        with TdmsWriter(path) as file:
            file.write_segment([ChannelObject("g", name, values[name], kept) for name, kept in properties.items()])

    return write


def _dspace(path: Path) -> None:
    fields = np.dtype([("Name", "O"), ("Data", "O"), ("Unit", "O"), ("XIndex", "O")])
    y, x = np.zeros((1, 2), fields), np.zeros((1, 1), fields)
    x[0, 0] = ("t", T[None], "s", 0)
    y[0, 0], y[0, 1] = ("Force", FORCE[None], "N", 1), ("Position", POSITION[None], "m", 1)
    scipy.io.savemat(path, {"rec001": {"X": x, "Y": y}})


def _hdf5(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("run")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("t", T), ("F", FORCE), ("x", POSITION)):
            group[name] = values[None]
            group[name].attrs["MATLAB_class"] = np.bytes_("double")


def _sheet(path: Path) -> None:
    with xlsxwriter.Workbook(str(path)) as book:
        book.add_worksheet("about").write_row(0, 0, ["rig 7"])
        sheet = book.add_worksheet("data")
        sheet.write_row(0, 0, ["measured by me"])
        sheet.write_row(1, 0, ["Time", "Force", "Position"])
        sheet.write_row(2, 0, ["s", "N", "m"])
        for row, values in enumerate(zip(T, FORCE, POSITION, strict=True)):
            sheet.write_row(row + 3, 0, values)


def _text_sheet(path: Path) -> None:
    with xlsxwriter.Workbook(str(path)) as book:
        sheet = book.add_worksheet("data")
        sheet.write_row(0, 0, ["Zeit", "Kraft"])
        for row, (time, force) in enumerate(zip(T, FORCE, strict=True)):
            sheet.write_number(row + 1, 0, time)
            sheet.write_string(row + 1, 1, german(f"{force:.5f}"))


def _record(path: Path) -> None:
    table = np.zeros(len(T), [("t", "f8"), ("n", "i4")])
    table["t"] = T
    with h5py.File(path, "w") as file:
        file["table"], file["x"], file["data"] = table, 1e3 * POSITION, np.column_stack([T, FORCE])
        file["x"].attrs["units"] = "mm"


def _parquet(path: Path) -> None:
    stamps = pa.array((T * 1e9).round().astype(np.int64), pa.duration("ns"))
    pq.write_table(pa.table({"stamp": stamps, "ft": pa.StructArray.from_arrays([pa.array(FORCE)], ["force"])}), path)


_HEADER = "std_msgs/Header header\n"
_TYPES = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
}


def _ros(path: Path) -> None:
    """A wrench at 500 Hz and the state of a joint at 100 Hz."""
    more = "".join(f"{'=' * 80}\nMSG: {name}\n{text}\n" for name, text in _TYPES.items())
    with path.open("wb") as file:
        writer = Writer(file)
        wrench = writer.register_msgdef("geometry_msgs/WrenchStamped", _HEADER + "geometry_msgs/Wrench wrench\n" + more)
        joint = writer.register_msgdef("sensor_msgs/JointState", _HEADER + "string[] name\nfloat64[] position\n" + more)
        for i, (s, f, x) in enumerate(zip(T, FORCE, POSITION, strict=True)):
            at_ns = 1_700_000_000_000_000_000 + round(s * 1e9)
            header = {"stamp": {"sec": at_ns // 10**9, "nanosec": at_ns % 10**9}, "frame_id": "rig"}
            forces = {"force": {"x": f, "y": 0.0, "z": 94.5}, "torque": {"x": 0.0, "y": 0.0, "z": 0.0}}
            writer.write_message("/ft", wrench, {"header": header, "wrench": forces}, at_ns + 50_000, at_ns)
            if i % 5 == 0 or i == len(T) - 1:
                writer.write_message(
                    "/joints", joint, {"header": header, "name": ["slide"], "position": [x]}, at_ns, at_ns
                )
        writer.finish()


_LVM = (
    "LabVIEW Measurement\t\r\nWriter_Version\t2\r\nSeparator\tTab\r\nDecimal_Separator\t,\r\nX_Columns\tOne\r\n***End_of_Header***"
    "\t\r\n\t\r\nChannels\t2\t\r\nSamples\t1000\t1000\r\nDelta_X\t2,000000E-3\t2,000000E-3\r\n***End_of_Header***\t\t\r\n"
)
TFX = ("t", "F", "x")
EVEN = slice(0, 1000, 2)
KINDS = (
    Kind("no-header.csv", rows(T, FORCE), ("1", "2", "")),
    Kind("units-row.csv", "Time,Force,Position\ns,N,m\n" + rows(T, FORCE, POSITION, form="{:.8f}"), ("Time", "Force", "Position")),
    Kind("kilo-row.csv", "Time;Force\n[ms];[kN]\n" + rows(1e3 * T, 1e-3 * FORCE, sep=";", form="{:.8f}"), ("Time", "Force", ""), says="is in kN: times 1000"),
    Kind("units-in-names.dat", "Zeit / ms\tKraft (mN)\tWeg [mm]\n" + rows(1e3 * T, 1e3 * FORCE, 1e3 * POSITION, sep="\t"), ("Zeit", "Kraft", "Weg")),
    Kind("stroke.dat", "Zeit/ms\tKraft/mN\ts/mm\n" + german(rows(1e3 * T, 1e3 * FORCE, 1e3 * POSITION, sep="\t")), ("Zeit", "Kraft", "s")),
    Kind("days.csv", "Timestamp,F\n" + "".join(f"{46082.75 + s / 86400:.11f},{f:.5f}\n" for s, f in zip(T, FORCE, strict=True)), ("Timestamp", "F", ""), says="calendar time in steps of 86400 s"),
    Kind("names-twice.csv", "Time,Force,Time,Position\n" + rows(T, FORCE, T, POSITION), ("Time", "Force", "")),
    Kind("iso-time.csv", "timestamp,F\n" + rows(_STAMPS, FORCE), ("timestamp", "F", ""), says="counted in seconds from the first row"),
    Kind("clock.csv", "Zeit;F\n" + german(rows([s[11:] for s in _STAMPS], FORCE, sep=";")), ("Zeit", "F", "")),
    Kind("date-and-clock.txt", "Date\tF\n" + rows([f"01.03.2026 {s[11:]}" if s < "2026-03-02" else f"02.03.2026 {s[11:]}" for s in _STAMPS], FORCE, sep="\t"), ("Date", "F", "")),
    Kind("day-stroke-month.csv", "Date,F\n" + rows([f"{day:02d}/03/2026 {s[11:]}" for s in _STAMPS for day in [int(s[8:10])]], FORCE), ("Date", "F", "")),
    Kind("month-stroke-day.csv", "Date,F\n" + rows([f"03/{day:02d}/2026 {s[11:]}" for s in _STAMPS for day in [int(s[8:10])]], FORCE), ("Date", "F", "")),
    Kind("short-year.csv", "Date,F\n" + rows([s[2:].replace("T", " ") for s in _STAMPS], FORCE), ("Date", "F", "")),
    Kind("month-by-name.csv", "Date,F\n" + rows([f"{s[8:10]}-Mar-2026 {s[11:]}" for s in _STAMPS], FORCE), ("Date", "F", ""), says="counted in seconds from the first row"),
    Kind("short-year-after-month.csv", "Date,F\n" + rows([f"{s[8:10]}-march-{s[2:4]} {s[11:]}" for s in _STAMPS], FORCE), ("Date", "F", "")),
    Kind("milliseconds.csv", "Time,F\n" + rows([f"{s[11:19]}:{s[20:23]}" for s in _STAMPS], FORCE), ("Time", "F", ""), says="counted in seconds from the first row"),
    Kind("milliseconds-not-padded.csv", "Time;F\n" + rows([f"{s[11:19]}:{int(s[20:23])}" for s in _STAMPS], FORCE, sep=";"), ("Time", "F", "")),
    Kind("dash.csv", "t,F\n" + rows(T, [f"\u2013{f:.5f}" for f in FORCE]), ("t", "F", ""), force_too=-1.0),
    Kind("minus.csv", "t,F\n" + rows(T, [f"\u2212{f:.5f}" for f in FORCE]), ("t", "F", ""), force_too=-1.0),
    Kind("hash-comments.csv", "# rig 7, 2026-03-01\n# 500 Hz\nt,F\n" + rows(T, FORCE), ("t", "F", "")),
    Kind("klipper.csv", "#time,accel_x,accel_y\n" + rows(T, FORCE, POSITION, form="{:.8f}"), ("time", "accel_x", "accel_y")),
    Kind("halsampler.txt", rows(T, FORCE, POSITION, sep=" ", form="{:.8f}"), ("1", "2", "3")),
    Kind("rate-above.txt", "Sampling rate: 500 Hz\n\nForce\n" + rows(FORCE), ("", "Force", ""), says="sample_rate_Hz = 500"),
    Kind("one-bad-cell.csv", "t,F\n" + rows(T, ["#NV" if i == 100 else f"{f:.5f}" for i, f in enumerate(FORCE)]), ("t", "F", "")),
    Kind("trailing-line.csv", "t,F\n" + rows(T, FORCE) + "Mean,,11.0\n", ("t", "F", ""), says="1 line with another number of cells"),
    Kind("german-excel.csv", ("Zeit [s];Kraft [N];Überweg [m]\r\n" + german(rows(T, FORCE, POSITION, sep=";", end="\r\n"))).encode("cp1252"), ("Zeit [s]", "Kraft [N]", "")),
    Kind("catman.csv", "HBM_CATMAN\r\nDATEINAME:\tC:\\a.bin\r\n\r\n\r\nZeit  1 [s]\tKraft  [N]\r\n" + german(rows(T, FORCE, sep="\t", end="\r\n")), ("Zeit  1 [s]", "Kraft  [N]", "")),
    Kind("wide.csv", ("t;F\n" + german(rows(T, FORCE, sep=";"))).encode("utf-16"), ("t", "F", "")),
    Kind("thousands.csv", "Zeit;Kraft\n" + "".join(f"{german(f'{a:.3f}')};{_grouped(1e3 * b)}\n" for a, b in zip(T, FORCE, strict=True)), ("Zeit", "Kraft", ""), force_too=1e3, says="thousands = '.'"),
    Kind("blanks.txt", "  time [s]     F [N]   x [m]\n" + rows(T, FORCE, POSITION, sep="   ", form="{:14.8f}"), ("time", "F", "x")),
    Kind("UPPER.CSV", "t,F\n" + rows(T, FORCE), ("t", "F", "")),
    Kind("labview.lvm", _LVM + "X_Value\tKraft\tWeg\tComment\r\n" + german(rows(T, FORCE, POSITION, sep="\t", end="\r\n")), ("X_Value", "Kraft", "")),
    Kind("plotjuggler.csv", "__time,/ft/force,/axis/position\n" + "".join(f"{1.7e9 + s:.6f},{f:.5f},\n" if i % 2 == 0 else f"{1.7e9 + s:.6f},,{p:.8f}\n" for i, (s, f, p) in enumerate(zip(T, FORCE, POSITION, strict=True))), ("__time", "/ft/force", "/axis/position"), slice(2, 1000, 2), says="has its own clock"),
    Kind("rosbag.csv", "%time,field.wrench.force.x\n" + "".join(f"{1_700_000_000_000_000_000 + round(s * 1e9)},{f:.5f}\n" for s, f in zip(T, FORCE, strict=True)), ("%time", "field.wrench.force.x", ""), says="calendar time"),
    Kind("sec-nanosec.csv", "header.stamp.sec,header.stamp.nanosec,F\n" + "".join(f"{1_700_000_000 + int(s)},{round(s % 1 * 1e9)},{f:.5f}\n" for s, f in zip(T, FORCE, strict=True)), ("header.stamp.sec", "F", ""), says="both are one time"),
    Kind("minutes.csv", "Elapsed,F\n" + rows([f"{(3599 + s) % 3600 // 60:02.0f}:{(59 + s) % 60:06.3f}" for s in T], FORCE), ("Elapsed", "F", "")),
    Kind("unit-in-cells.csv", "t,F\n" + "".join(f"{s:.6f},{f'{f:.5f} N' if i % 3 else f'{1e3 * f:.2f} mN'}\n" for i, (s, f) in enumerate(zip(T, FORCE, strict=True))), ("t", "F", ""), says="has the unit N in its cells"),
    Kind("names-of-two-lines.csv", '"Time\n[s]";"Force\n[kN]"\n' + rows(T, 1e-3 * FORCE, sep=";", form="{:.8f}"), ("Time", "Force", ""), says="is in kN: times 1000"),
    Kind("record.h5", _record, ("table.t", "data[1]", "x"), says="x is in mm: times 0.001"),
    Kind("struct.parquet", _parquet, ("stamp", "ft.force", "")),
    Kind("numbers-as-text.xlsx", _text_sheet, ("Zeit", "Kraft", "")),
    Kind("dspace.mat", _dspace, ("rec001.X.Data", "rec001.Y[0].Data", "Position")),
    Kind("dspace-names.mat", _dspace, ("", "Force", "Position")),
    Kind("v73.mat", _hdf5, ("run.t", "run.F", "run.x")),
    Kind("ros.mcap", _ros, ("", "/ft.wrench.force.x", "/joints.position[slide]"), says="has its own clock"),
    Kind("book.xlsx", _sheet, ("Time", "Force", "Position")),
    Kind("two-rates.tdms", _tdms(Force={"wf_increment": 2e-3}, Temperature={"wf_increment": 1.0}), ("", "Force", "")),
    Kind("start-offset.tdms", _tdms(Force={"wf_increment": 2e-3}, Position={"wf_increment": 2e-3, "wf_start_offset": 0.05}), ("", "Force", "Position"), slice(25, 1000), says="begins 0.05 s later"),
)  # fmt: skip
# the programs of a page that `make docs` makes, by the file that is written as they write it
PROGRAMS = {
    "german-excel.csv": "Excel, CSV with decimal commas",
    "book.xlsx": "Excel, LibreOffice: workbooks",
    "klipper.csv": "Klipper, raw data of an accelerometer",
    "halsampler.txt": "LinuxCNC halsampler",
    "catman.csv": "HBM catman, ASCII",
    "labview.lvm": "LabVIEW, .lvm",
    "two-rates.tdms": "LabVIEW, TDMS",
    "plotjuggler.csv": "PlotJuggler, CSV",
    "rosbag.csv": "rostopic echo -p, CSV of ROS 1",
    "sec-nanosec.csv": "ros2 topic echo --csv",
    "ros.mcap": "ROS 2, rosbag2 in MCAP",
    "dspace-names.mat": "dSPACE ControlDesk, .mat",
    "v73.mat": "MATLAB v7.3",
    "record.h5": "HDF5 of h5py and PyTables",
    "struct.parquet": "Parquet of pandas, Polars and Arrow",
}


def write(kind: Kind, folder: Path) -> Path:
    """The file of a kind."""
    path = folder / kind.file
    if callable(kind.content):
        kind.content(path)
    else:
        path.write_bytes(kind.content.encode() if isinstance(kind.content, str) else kind.content)
    return path
