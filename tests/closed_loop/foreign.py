"""The model of `foreign.c` as an FMU, and its rig file."""

import subprocess
import zipfile
from pathlib import Path
from typing import Any

from bridge.fmu.export import _headers
from tests.unit.bridge.rig.boxes import GUARD, toml

SOURCE = Path(__file__).with_name("foreign.c")
INPUTS = ["carriage speed", "tone", "stroke", "load", "fault"]
OUTPUTS = ["pull", "g slide", "g table", "x slide", "x carriage"]
SAMPLES = {2: 1, 3: 10}  # of an output in a step, by version of FMI
NOISE = {"pull": 0.02, "g slide": 0.001, "g table": 0.001, "x slide": 2e-4, "x carriage": 2e-4}
CHANNELS = {
    "drive_force_N": {"source": 0},
    "mass_accel_mps2": {"source": 1, "scale": 9.80665},
    "base_accel_mps2": {"source": 2, "scale": 9.80665},
    "mass_position_m": {"source": 3, "scale": 1e-3},
    "drive_position_m": {"source": 4, "scale": 1e-3},
}


def foreign_fmu(out: Path, fmi: int = 3) -> Path:
    """Compile the model and write it as an FMU."""
    library = out.with_suffix(".so")
    words = ["-std=gnu11", "-w", "-O2", "-fPIC", "-shared", f"-DFMI={fmi}", f"-I{_headers()}"]
    subprocess.run(["cc", *words, str(SOURCE), "-o", str(library), "-lm"], check=True)
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("modelDescription.xml", _description_2() if fmi == 2 else _description_3())
        archive.write(library, f"binaries/{'linux64' if fmi == 2 else 'x86_64-linux'}/foreign.so")
    return out


def _rows() -> list[tuple[str, str, str, str]]:
    rows = [(name, "input", 'start="0"') for name in INPUTS] + [(name, "output", "") for name in OUTPUTS]
    return [
        (f'name="{name}" valueReference="{row}"', kind, start, f"{row}") for row, (name, kind, start) in enumerate(rows)
    ]


def _description_2() -> str:
    rows = "".join(
        f'<ScalarVariable {name} causality="{kind}"><Real {start}/></ScalarVariable>'
        for name, kind, start, _ in _rows()
    )
    unknowns = "".join(f'<Unknown index="{len(INPUTS) + row + 1}"/>' for row in range(len(OUTPUTS)))
    return f"""<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="1">
<CoSimulation modelIdentifier="foreign"/><DefaultExperiment stopTime="1e8"/><ModelVariables>{rows}</ModelVariables>
<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"""


def _description_3() -> str:
    size = f'<Dimension start="{SAMPLES[3]}"/>'
    rows = "".join(
        f'<Float64 {name} causality="{kind}" {start}>{size if kind == "output" else ""}</Float64>'
        for name, kind, start, _ in _rows()
    )
    outputs = "".join(f'<Output valueReference="{row}"/>' for _, kind, _, row in _rows() if kind == "output")
    return f"""<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="foreign" instantiationToken="1">
<CoSimulation modelIdentifier="foreign"/><DefaultExperiment stopTime="1e8"/><ModelVariables>{rows}</ModelVariables>
<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"""


def rig_of(fmu: Path, **device: Any) -> Path:
    """Write the rig file of the model, next to it."""
    settings = {
        "file": fmu.name,
        "frequency": "tone",
        "amplitude": "stroke",
        "outputs": OUTPUTS,
        "noise": NOISE,
        "set": {"carriage speed": 0.5, "load": 1.0, "fault": 0.0},
        "speed": "carriage speed",
        "units_per_mps": 1e3,
        "load": "load",
    }
    path = fmu.with_suffix(".toml")
    exciter = {"enable_line": True, "stroke_m_per_V": 1e-3}
    table = {"name": fmu.stem, "adapter": "fmu", "channels": CHANNELS, "guard": GUARD, "exciter": exciter}
    path.write_text(toml(table | {"device": settings | device}))
    return path
