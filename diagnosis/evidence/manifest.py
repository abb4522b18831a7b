"""`manifest.toml` of an evidence folder, its keys and its text: the rig with its tolerances, the channels and the runs."""

import json
import math
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from bridge.config import Strict, in_short, read_toml, validate
from bridge.faults import Fault
from bridge.files import check_file, shown
from diagnosis.evidence.assumed import with_assumed
from diagnosis.evidence.manifest_keys import (
    ChannelMap,
    NotNegative,
    Positive,
    SourceMap,
    check_channel_names,
    with_numbers,
)

FORMAT = "evidence/1"
MANIFEST = "manifest.toml"
# suffixes of data files, in upper or lower case; the first bytes of a table give its format
RUN_SUFFIXES = (
    ".parquet", ".csv", ".txt", ".dat", ".lvm", ".tsv", ".asc", ".mat", ".tdms", ".xlsx", ".xls", ".ods", ".h5", ".mcap",
)  # fmt: skip
_NOT_WITH_FORCE = ("drive_stiffness_N_per_m", "drive_damping_Ns_per_m")

# Highest natural frequency of the mass on a stiffness. Larger: the plant's step becomes unstable in fits, which vary mass and
# stiffness within their tolerances; the plant refuses such numbers. Smaller: stiff rigs are refused.
_FASTEST_RAD_PER_S = {
    "contact_stiffness_N_per_m": 9e4,  # the plant refuses 1e5, the inverse of its step; 7.2e3 on the paper's rig
    "drive_stiffness_N_per_m": 3e4,  # the plant refuses 3.14e4; 88 on the paper's rig
}
_LONGEST_SLIP_S = 5.0  # a longer slip means a wrong unit of mass or stiffness
_FASTEST_MPS = 10.0  # largest velocity of a drive; in mm/s even a slow drive exceeds it
DriveVelocity = Annotated[float, Field(ge=-_FASTEST_MPS, le=_FASTEST_MPS)]


class RigTable(Strict):
    """The rig as the owner describes it, SI units."""

    drive: Literal["spring", "force", "torsion"] = Field(
        description="torsion: a rotary rig; every number in N m, rad and kg m2 in place of N, m and kg."
    )
    radius_m: Positive | None = Field(
        default=None,
        description='With drive = "torsion": radius at which the results are given in N and m; 1 if not given.',
    )
    mass_kg: Positive = Field(description="If not given, the mass that the runs show.")
    drive_stiffness_N_per_m: Positive | None = Field(default=None, description='Not with drive = "force".')
    drive_damping_Ns_per_m: NotNegative | None = Field(default=None, description='Not with drive = "force".')
    contact_stiffness_N_per_m: Positive
    contact_damping_Ns_per_m: NotNegative
    viscous_damping_Ns_per_m: NotNegative
    coulomb_force_N: Positive
    static_force_N: Positive
    stribeck_velocity_mps: Positive
    force_per_current_N_per_A: Positive | None = Field(
        default=None, description='With drive = "force": force of the motor per ampere of motor_current_A.'
    )
    tolerance: dict[str, float] = Field(
        default={}, description="One standard deviation, relative; a number without a tolerance is known exactly."
    )

    @model_validator(mode="after")
    def _fits_together(self) -> "RigTable":
        for key in _NOT_WITH_FORCE:
            given = getattr(self, key) is not None
            if self.drive != "force" and not given:
                raise ValueError(f'{key}: missing; a rig with drive = "{self.drive}" needs it')
            if self.drive == "force" and given:
                raise ValueError(f'{key}: unknown with drive = "force"; remove it, or set drive = "spring"')
        if self.radius_m is not None and self.drive != "torsion":
            raise ValueError('radius_m: unknown without drive = "torsion"; remove it, or set drive = "torsion"')
        if self.force_per_current_N_per_A is not None and self.drive != "force":
            raise ValueError(
                'force_per_current_N_per_A: unknown without drive = "force"; the force of a spring is not the force of its motor'
            )
        if self.static_force_N < self.coulomb_force_N:
            raise ValueError(
                f"static_force_N = {self.static_force_N:g}: must not be below coulomb_force_N = "
                f"{self.coulomb_force_N:g}; exchange them or measure again"
            )
        for key, fastest_rad_per_s in _FASTEST_RAD_PER_S.items():
            stiffness_N_per_m = getattr(self, key) or 0.0
            swings_rad_per_s = (stiffness_N_per_m / self.mass_kg) ** 0.5
            if swings_rad_per_s > fastest_rad_per_s:
                raise ValueError(
                    f"{key} = {stiffness_N_per_m:g} on mass_kg = {self.mass_kg:g}: swings at "
                    f"{swings_rad_per_s:.3g} rad/s: must be {fastest_rad_per_s:g} at most; check their units"
                )
        slip_s = math.pi * (self.mass_kg / self.drive_stiffness_N_per_m) ** 0.5 if self.drive_stiffness_N_per_m else 0.0
        if slip_s > _LONGEST_SLIP_S:
            raise ValueError(
                f"mass_kg = {self.mass_kg:g} on drive_stiffness_N_per_m = {self.drive_stiffness_N_per_m:g}: a slip would take "
                f"{slip_s:.3g} s: must be {_LONGEST_SLIP_S:g} s at most; check their units"
            )
        known = [name for name, value in self.values().items() if value is not None]
        for key, share in self.tolerance.items():
            if key not in known:
                raise ValueError(f"tolerance.{key} = {share!r}: unknown key; known here: {', '.join(known)}")
            if not 0.0 <= share <= 1.0:
                raise ValueError(f"tolerance.{key} = {share:g}: must be from 0 to 1; it is relative, 0.02 means 2 %")
        return self

    def values(self) -> dict[str, float | None]:
        """The rig numbers by name, SI units; None where the drive has no such part."""
        return {
            name: getattr(self, name)
            for name in RigTable.model_fields
            if name not in {"drive", "tolerance", "radius_m", "force_per_current_N_per_A"}
        }


# number of [rig] -> table and key of a rig file; the tail of the Stribeck curve is refitted, and no manifest states it
PLACES: Final = {
    "mass_kg": ("slide", "mass_kg"),
    "drive_stiffness_N_per_m": ("drive", "stiffness_N_per_m"),
    "drive_damping_Ns_per_m": ("drive", "damping_Ns_per_m"),
} | {
    name: ("contact", name.removeprefix("contact_"))
    for name in (
        "contact_stiffness_N_per_m", "contact_damping_Ns_per_m", "viscous_damping_Ns_per_m", "coulomb_force_N",
        "static_force_N", "stribeck_velocity_mps", "stribeck_tail",
    )
}  # fmt: skip


def rig_file_tables(values: Mapping[str, float | None]) -> dict[str, dict[str, float]]:
    """Numbers of [rig] in the tables of a rig file; the static force is at least the Coulomb force, as the plant needs."""
    tables: dict[str, dict[str, float]] = {}
    for name, (part, key) in PLACES.items():
        if (value := values.get(name)) is not None:
            tables.setdefault(part, {})[key] = value
    tables["contact"]["static_force_N"] = max(tables["contact"]["static_force_N"], tables["contact"]["coulomb_force_N"])
    return tables


def rig_numbers(rig: Any) -> dict[str, float]:
    """The numbers of [rig], from the configuration of a plant's rig."""
    return {
        name: getattr(getattr(rig, part), key) for name, (part, key) in PLACES.items() if name in RigTable.model_fields
    }


class RunTable(Strict):
    """One run of the manifest."""

    file: Annotated[str, Field(min_length=1)]
    drive_velocity_mps: DriveVelocity | None = None
    holdout: bool = False
    from_s: NotNegative = Field(default=0.0, description="Begin of the run, since the first sample of its file.")
    until_s: Positive | None = Field(default=None, description="End of the run; the end of the file if not given.")
    tare_N: float = Field(default=0.0, description="Reading of the force sensor without a force; subtracted.")
    normal_load_N: Positive | None = Field(default=None, description="Constant load, where no column gives it.")
    channels: dict[str, ChannelMap] = Field(default={}, description="Channels that differ from [channels] in this run.")
    source: SourceMap = Field(default=SourceMap(), description="How the file is written, as in a channel map.")
    piece: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="Number of the run in a file whose time begins again."
    )

    @property
    def name(self) -> str:
        """Name of the file, with piece and limits in time if the run is a part of it: `log-2.csv`, `log-0-to-9s.csv`."""
        path = PurePath(self.file)
        if self.piece is not None:
            path = path.with_name(f"{path.stem}-{self.piece}{path.suffix}")
        if self.from_s == 0.0 and self.until_s is None:
            return str(path)
        until = "end" if self.until_s is None else f"{self.until_s:g}s"
        return str(path.with_name(f"{path.stem}-{self.from_s:g}-to-{until}{path.suffix}"))

    @model_validator(mode="after")
    def _is_right(self) -> "RunTable":
        check_channel_names(self.channels)
        if self.until_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"until_s = {self.until_s:g}: must be above from_s = {self.from_s:g}; exchange them")
        path = PurePath(self.file)
        if path.is_absolute() or ".." in path.parts:
            raise ValueError(f"file = {self.file!r}: must lie in the evidence folder; copy it there")
        if path.suffix.lower() not in RUN_SUFFIXES:
            raise ValueError(f"file = {self.file!r}: must end in {', '.join(RUN_SUFFIXES)}; see `stickslip log import`")
        return self


class Manifest(Strict):
    """All keys of `manifest.toml`."""

    format: Literal["evidence/1"]
    rig: RigTable
    channels: dict[str, ChannelMap] = {}
    numbers: dict[str, float] = Field(default={}, description="Numbers by name, for the formulas of derived channels.")
    run: Annotated[list[RunTable], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_are_right(self) -> "Manifest":
        check_channel_names(self.channels)
        for channels in (self.channels, *(run.channels for run in self.run)):
            channels.update(with_numbers(channels, self.numbers))
        names = [str(PurePath(run.name).with_suffix("")) for run in self.run]
        counts = Counter(names)
        for run, name in zip(self.run, names, strict=True):
            if counts[name] > 1:
                raise ValueError(
                    f"run.file = {run.file!r}: {counts[name]} runs are called {name!r}; each run needs another file, "
                    "as its name without the suffix identifies it: rename one, or give their stretches by from_s and until_s"
                )
        _refuse_overlap(self.run)
        if all(run.holdout for run in self.run):
            raise ValueError("run.holdout = true for every run: must be false for one at least; nothing is left to fit")
        return self


def _refuse_overlap(runs: list[RunTable]) -> None:
    """Raise ValueError where two runs share a stretch of a file: a held-out stretch must not be fitted."""
    ordered = sorted(runs, key=lambda run: (run.file, run.piece or 0, run.from_s))
    for run, after in pairwise(ordered):
        if (run.file, run.piece) == (after.file, after.piece) and after.from_s < (
            math.inf if run.until_s is None else run.until_s
        ):
            raise ValueError(
                f"run.from_s = {after.from_s:g} of {run.file!r}: another run has this stretch as well: must begin where the "
                "other run ends; set until_s"
            )


def check_folder(folder: Path) -> None:
    """Raise Fault BAD_EVIDENCE where `folder` is not a folder."""
    try:
        problem = "" if folder.is_dir() else "no folder" if folder.exists() else "no such folder"
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
    if problem:
        line = f"{folder}: {problem}; evidence is a folder with {MANIFEST} and one data file a run"
        raise Fault("BAD_EVIDENCE", line)


def read_manifest(folder: Path) -> Manifest:
    """Read and check `manifest.toml` of an evidence folder. Raises Fault BAD_EVIDENCE, with one line for each problem."""
    return described(folder)[0]


def described(folder: Path, mass_kg: float | None = None) -> tuple[Manifest, list[str]]:
    """`manifest.toml` of an evidence folder, and the names of the rig numbers that are assumed, as it leaves them out.

    Raises Fault BAD_EVIDENCE, with one line for each problem.

    Args:
        folder: the evidence folder.
        mass_kg: the mass estimated from the runs, for a manifest without a mass.

    """
    if shown(folder) != str(folder):
        raise Fault("BAD_EVIDENCE", f"{shown(folder)}: its name is not UTF-8; rename it")
    check_folder(folder)
    path = folder / MANIFEST
    check_file(path, "BAD_EVIDENCE", "an evidence folder needs it, see `stickslip log import`")
    if not path.resolve().is_relative_to(folder.resolve()):
        line = f"{path}: is a link that leads out of the folder: must be a file in it; copy the file there"
        raise Fault("BAD_EVIDENCE", line)
    try:
        table = read_toml(path)
        if "format" in table and table["format"] != FORMAT:
            line = f'{MANIFEST}: format = {in_short(table["format"])}: must be "{FORMAT}"; this version reads no other'
            raise Fault("BAD_EVIDENCE", line)
        assumed: list[str] = []
        if isinstance(table.get("rig"), dict):
            table["rig"], assumed = with_assumed(table["rig"], mass_kg)
        return validate(Manifest, table, MANIFEST), assumed
    except Fault as fault:
        raise Fault("BAD_EVIDENCE", fault.line) from None


def manifest_text(rig: RigTable, runs: list[RunTable], assumed: list[str]) -> str:
    """Text of a `manifest.toml` with this rig and these runs; rig numbers in `assumed` are marked as assumed."""
    lines = [f"format = {_value(FORMAT)}", "", *rig_lines(rig, assumed)]
    for run in runs:
        lines += ["", "[[run]]"]
        plain = run.model_dump(exclude={"channels", "source"})
        usual = {"from_s": 0.0, "tare_N": 0.0}
        lines += [f"{name} = {_value(value)}" for name, value in plain.items() if value not in (None, usual.get(name))]
        tables = {
            f"channels.{name}": channel.model_dump(exclude_defaults=True) for name, channel in run.channels.items()
        }
        for name, table in (tables | {"source": run.source.model_dump(exclude_defaults=True)}).items():
            if table:
                shown = {key: value for key, value in table.items() if key != "derive"}
                lines.append(f"{name} = {{ {', '.join(f'{key} = {_value(value)}' for key, value in shown.items())} }}")
    return "\n".join(lines) + "\n"


def rig_lines(rig: RigTable, assumed: list[str]) -> list[str]:
    """The lines of [rig] and [rig.tolerance]."""
    lines = ["[rig]", f"drive = {_value(rig.drive)}"]
    numbers = {"radius_m": rig.radius_m, **rig.values(), "force_per_current_N_per_A": rig.force_per_current_N_per_A}
    for name, value in numbers.items():
        if value is not None:
            lines.append(f"{name} = {_value(value)}" + ("  # assumed, not measured" if name in assumed else ""))
    if rig.tolerance:
        lines += ["", "[rig.tolerance]", *(f"{name} = {_value(value)}" for name, value in rig.tolerance.items())]
    return lines


def _value(value: Any) -> str:
    """A number, a truth value or a text in TOML: as in JSON, except DEL; `repr` keeps every digit of a number."""
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
