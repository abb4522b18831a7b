# ruff: noqa: E501  a table of refusals has a row for each
"""Each remedy that a refusal of `look`, of `log import` or of a manifest prints is followed, and works."""

import json
import shlex
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from cockpit.cli import app
from diagnosis.evidence.folder import load_evidence
from tests.evidence_folder import columns, folder
from tests.unit.cockpit.files_of_others import FORCE_N, PLACE_MM, T_S, rows

HALF = len(T_S) // 2
PLAIN = "t [s],F [N]\n" + rows(T_S, FORCE_N)
ODD = "".join(f"{t:.3f}#{force:.3f}\n" for t, force in zip(T_S, FORCE_N, strict=True))
MAP = '[channels]\nt_s = "t [s]"\ndrive_force_N = {force}\n'
RIG = (
    MAP.format(force='"F [N]"')
    + "[run]\ndrive_velocity_mps = 1e-3\n[rig]\ndrive = 'spring'\nmass_kg = 1.5\ndrive_stiffness_N_per_m = 1e4\nstatic_force_N = 14.0\ncoulomb_force_N = 11.0\n"
)
IMPORT = "log import FILE --out made"


class Refused(NamedTuple):
    """A file that is refused, part of the refusal, and the words or the files that follow its remedy."""

    name: str
    text: str
    words: str  # of the command, with FILE and MAP in the place of the file and of its map
    line: str
    remedy: str  # the words that follow it
    map: str = ""
    mended: str = ""  # the map that follows it


def by_option(name: str, text: str, words: str, line: str, remedy: str) -> Refused:
    """A refusal of `look` whose remedy is an option in the place of the given words."""
    return Refused(name, text, f"look FILE {words}", line, f"look FILE {remedy}")


def by_map(name: str, text: str, line: str, given: str, mended: str) -> Refused:
    """A refusal of `look` whose remedy is another key of its map."""
    return Refused(name, text, "look FILE --map MAP", line, "look FILE --map MAP", given, mended)


REFUSED = [
    by_option("piece.csv", "t [s],F [N]\n" + 2 * rows(T_S[:HALF], FORCE_N[:HALF]), "--piece 9", "--piece 9: must be from 1 to 2", "--piece 2"),
    by_option("speed.csv", PLAIN, "--speed 0.5", "has no unit, such as m/s; write for example --speed 0.5mm/s", "--speed 0.5mm/s"),
    by_option("mass.csv", PLAIN, "--mass 1.5N", "must be a mass above 0; write for example --mass 1.5kg", "--mass 1.5kg"),
    by_option("no-time.csv", "F [N],a\n" + rows(FORCE_N, 5.0 + FORCE_N**2), "--force F", 'Add --time "NAME" or --rate 1kHz', "--force F --rate 1kHz"),
    by_option("no-force.csv", "t [s],p,q\n" + rows(T_S, FORCE_N, np.sin(T_S)), "", 'which column is the force? add --force "NAME"', "--force p"),
    by_option("empty-force.csv", "t [s],force,p\n" + "".join(f"{t:.3f},,{force:.3f}\n" for t, force in zip(T_S, FORCE_N, strict=True)), "", 'must hold the force, by its name; let a spreadsheet program calculate and save its formulas, or add --force "NAME"', "--force p"),
    by_option("no-column.csv", PLAIN, "--force Fx", "column Fx: not in the file; known here: t [s], F [N]", "--force 'F [N]'"),
    by_option("unit.csv", "Time [shake],F [N]\n" + rows(T_S, FORCE_N), "", "'shake' is not a known unit of time; add --rate 1kHz", "--rate 1kHz"),
    by_option("whole.csv", "time,F [N]\n" + "".join(f"{2 * i},{force:.3f}\n" for i, force in enumerate(FORCE_N)), "", 'add --time "time [ms]"', '--time "time [ms]"'),
    by_option("fast.csv", "t,F [N],x [m]\n" + rows(1e-3 * T_S, FORCE_N, PLACE_MM), "", 'is the time right? add --time "NAME [ms]" or --rate 1kHz', "--rate 1kHz --speed 1mm/s"),
    by_option("far.csv", "t [s],F [N],pos\n" + rows(T_S, FORCE_N, 1e3 * PLACE_MM), "", 'Add --position "NAME [mm]" or --speed 0.5mm/s', '--position "pos [mm]"'),
    by_option("light.csv", "t [s],F [nN],x [mm]\n" + rows(T_S, FORCE_N, PLACE_MM), "", "or --speed 0.5mm/s", "--speed 1um/s"),
    by_option("turns.csv", "t [s],M [N m]\n" + rows(T_S, FORCE_N), "--speed 1mm/s", "must be a speed such as 10mrad/s", "--speed 10mrad/s"),
    by_option("rate-beside-time.csv", "t [s],F [N],t2 [ms]\n" + rows(np.sin(1e3 * T_S), FORCE_N, 1e3 * T_S), "", "give --time with another column, or --rate", '--time "t2 [ms]"'),
    by_option("spectrum.csv", "freq [Hz],F [N],at\n" + rows(T_S, FORCE_N, T_S), "", "this is a spectrum: must be a record over time; give the record that it was made from, or name another column by --time", '--time "at [s]"'),
    by_option("encoding.csv", "Zeit [s],Kräft [N]\n" + rows(T_S, FORCE_N), "--force 'Kräft [N]' --encoding ascii", "leave source.encoding out, or state another (with `look`: --encoding)", "--force 'Kräft [N]' --encoding utf-8"),
    by_option("no-encoding.csv", PLAIN, "--encoding nonsense", "unknown to Python; leave it out, or try latin-1", "--encoding latin-1"),
    Refused("map.csv", PLAIN, "look FILE --map MAP --out map.toml", "no map to write: --map was given, or the file is a run log or holds no force; leave it out", "look FILE --map MAP", MAP.format(force='"F [N]"'), MAP.format(force='"F [N]"')),
    by_map("no-time-in-map.csv", "F [N]\n" + rows(FORCE_N), 'channels.t_s = "NAME", or add under [source] sample_rate_Hz = 1000.0', '[channels]\ndrive_force_N = "F"\n', '[source]\nsample_rate_Hz = 1000.0\n[channels]\ndrive_force_N = "F"\n'),
    by_map("current.csv", "t [s],I [A]\n" + rows(T_S, FORCE_N), "name another column, or give channels.drive_force_N.scale", MAP.format(force='"I [A]"'), MAP.format(force='{ column = "I [A]", scale = 7.0 }')),
    by_map("no-channel.csv", PLAIN, "channels: must name drive_force_N or mass_accel_mps2", '[channels]\nt_s = "t"\n', MAP.format(force='"F [N]"')),
    by_map("no-force-in-map.csv", "t [s],F [N],a [m/s2]\n" + rows(T_S, FORCE_N, PLACE_MM), "map a force in [channels]", '[channels]\nt_s = "t"\nmass_accel_mps2 = "a"\n', MAP.format(force='"F [N]"')),
    by_map("other-name.csv", PLAIN, "column Q: not in the file; known here: t [s], F [N]", MAP.format(force='"Q"'), MAP.format(force='"F [N]"')),
    by_map("clock.csv", "t [s],F [N]\n" + "".join(f"10:00:{t:06.3f},{force:.3f}\n" for t, force in zip(T_S, FORCE_N, strict=True)), "scale must be left out", MAP.format(force='"F [N]"').replace('"t [s]"', '{ column = "t [s]", scale = 1e-3 }'), MAP.format(force='"F [N]"')),
    by_map("odd.csv", "one\ntwo\n" + ODD, "state source.delimiter and source.skip_rows", '[channels]\nt_s = "1"\ndrive_force_N = "2"\n', '[source]\ndelimiter = "#"\nskip_rows = 1\n[channels]\nt_s = "1"\ndrive_force_N = "2"\n'),
    Refused("no-speed.csv", PLAIN, IMPORT, "the speed of the drive is unknown; add --speed 0.5mm/s", f"{IMPORT} --speed 0.5mm/s"),
    Refused("short.csv", "t [s],F [N]\n" + rows(T_S[::5], FORCE_N[::5]), f"{IMPORT} --speed 1mm/s", "too short to estimate the mass of the slide; add --mass 1.5kg", f"{IMPORT} --speed 1mm/s --mass 1.5kg"),
    Refused("mu.csv", "t [s],mu\n" + rows(T_S, FORCE_N), f"{IMPORT} --speed 1mm/s", "the force is unknown; add --load 94.5N", f"{IMPORT} --speed 1mm/s --load 94.5N"),
    Refused("even.csv", "t [s],F [N]\n" + rows(T_S, 11.0 + 0.01 * np.sin(1e3 * T_S)), f"{IMPORT} --speed 1mm/s", "import it with a map that has [rig]", f"{IMPORT} --map MAP", "", RIG),
    Refused("ampere.csv", "t [s],current_A\n" + rows(T_S, FORCE_N / 7), f"{IMPORT}.mcap", "a map with scale = ... makes a force of it", f"{IMPORT}.mcap --map MAP", "", '[channels]\nt_s = "t"\ndrive_force_N = { column = "current_A", scale = 7.0 }\n'),
    Refused("no-rig.csv", PLAIN, f"{IMPORT} --map MAP", "rig: missing; an evidence folder needs it, or import into a .mcap file", f"{IMPORT}.mcap --map MAP", MAP.format(force='"F [N]"'), MAP.format(force='"F [N]"')),
    Refused("exists.csv", PLAIN, "log import FILE --out FILE.mcap --speed 1mm/s", "exists already; nothing was written; choose another --out", "log import FILE --out other.mcap --speed 1mm/s"),
]  # fmt: skip


def run(words: str, name: str) -> dict[str, Any]:
    """The result of a command, or its refusal with its status, as JSON."""
    typed = shlex.split(words.replace("FILE", name).replace("MAP", "map-of-it.toml"))
    result = CliRunner().invoke(app, [*typed, "--json"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return json.loads(result.stdout) | {"status": result.exit_code}


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case.name)
@pytest.mark.slow
def test_the_remedy_of_a_refusal_works(tmp_path: Path, case: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path(case.name).write_text(case.text, encoding="utf-8")
    Path("exists.csv.mcap").touch()
    Path("map-of-it.toml").write_text(case.map, encoding="utf-8")
    refused = run(case.words, case.name)
    assert refused["status"] == 2
    assert case.line in refused["line"]
    Path("map-of-it.toml").write_text(case.mended, encoding="utf-8")
    followed = run(case.remedy, case.name)
    assert followed["status"] == 0, followed


@pytest.mark.parametrize(
    ("given", "line", "mended"),
    [
        ({"piece": 9}, "run.piece = 9: must be from 1 to 2", {"piece": 2}),
        ({}, "holds 2 runs, and must hold one; give piece = 1 in [[run]]", {"piece": 1}),
        ({"piece": 1, "from_s": 1e6}, "must be before its end", {"piece": 1, "from_s": 1.0}),
    ],
)  # fmt: skip
def test_the_remedy_of_a_manifest_works(
    tmp_path: Path, given: Mapping[str, Any], line: str, mended: Mapping[str, Any]
) -> None:
    data = columns()
    path = folder(tmp_path, data)
    table = np.column_stack([data["t_s"], data["drive_force_N"], data["drive_position_m"]])
    head = "t_s,drive_force_N,drive_position_m"
    np.savetxt(path / "run-01.csv", np.concatenate([table, table]), delimiter=",", header=head, comments="")
    manifest = (path / "manifest.toml").read_text().replace("run-01.parquet", "run-01.csv")

    def state(keys: Mapping[str, Any]) -> None:
        text = "".join(f"{key} = {value}\n" for key, value in keys.items())
        (path / "manifest.toml").write_text(manifest.replace("[[run]]\n", f"[[run]]\n{text}"))

    state(given)
    with pytest.raises(Fault) as refused:
        load_evidence(path)
    assert line in refused.value.line
    state(mended)
    assert len(load_evidence(path).runs) == 1


def test_the_command_of_a_file_of_numpy_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("rig.npz", t=T_S, F=FORCE_N)
    line = run("look rig.npz", "")["line"]
    call = line.partition("as columns of a text: ")[2].replace("NAME", "made")
    load = 'import numpy; file = numpy.load("rig.npz"); t, F = file["t"], file["F"]; '
    subprocess.run([sys.executable, "-c", load + call], check=True)
    assert run("look made.csv", "")["status"] == 0
