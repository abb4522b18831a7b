"""Writes a rig as an FMU: model description, constants for C, and the shared library, in one archive."""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

import numpy as np

from bridge.faults import Fault, install
from bridge.files import replacing
from bridge.kernel_cache import sources_digest, usable_folder
from bridge.units import unit_of
from bridge.wire.channels import CHANNELS
from plant.config import RigConfig
from plant.records import PARAMS, TRUTH, build
from plant.simulate import held_velocity

_HERE = Path(__file__).parent
_NAME = "stickslip"  # of the library
_PLATFORM = "x86_64-linux"
# parameters by the name of the rig file, and the field that the kernel reads; other parameters are set at the export, as
# `plant.records.build` derives further numbers from them
_PARAMETERS = {
    "drive.damping_Ns_per_m": "h_d",
    "contact.viscous_damping_Ns_per_m": "h_v",
    "contact.stribeck_velocity_mps": "v_s",
}


class Exported(NamedTuple):
    """An FMU."""

    fmu: str  # its file
    rig: str
    size_bytes: int
    block_s: float  # step of the master

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        size = f"{self.size_bytes / 1000:.0f} kB, FMI 3.0, {_PLATFORM}"
        return [f"fmu      {self.fmu}: rig {self.rig}, {size}; step {self.block_s * 1e3:g} ms, or whole multiples"]


def export(rig: RigConfig, out: Path) -> Exported:
    """Write the FMU of a rig. Raises Fault CONFIG without a C compiler, MISSING_EXTRA without the headers of FMI, LOG_WRITE."""
    headers, compiler = _headers(), _compiler()
    params, state = build(rig)
    drive_mps = 0.0 if params[0].force_driven else float(held_velocity(rig)(np.zeros(1))[0])
    samples, block_s = rig.solver.samples_per_block, rig.solver.block_s
    content = params.tobytes() + state.tobytes() + version("stickslip").encode()
    token = f"{{{uuid.UUID(hashlib.sha256(content).hexdigest()[:32])}}}"
    fields: Any = PARAMS.fields
    offsets = {name: fields[name][1] for name in (*_PARAMETERS.values(), "F_c", "F_s")}
    defines = {
        "PARAMS_BYTES": params.nbytes, "STATE_BYTES": state.nbytes, "SAMPLES": samples, "BLOCK_S": repr(block_s),
        "TOKEN": f'"{token}"', "CHANNELS": len(CHANNELS), "TRUTHS": len(TRUTH), "PARAMETERS": len(_PARAMETERS),
        "START_DRIVE_MPS": repr(drive_mps), "START_FREQUENCY_HZ": repr(float(params[0].frequency_max_Hz)),
        "F_C_OFFSET": offsets["F_c"], "F_S_OFFSET": offsets["F_s"], "SLIDE_ROW": TRUTH.index("true_velocity_mps"),
    }  # fmt: skip
    model = "".join(f"#define {name} {value}\n" for name, value in defines.items())
    model += _array("unsigned char start_params", params.tobytes()) + _array(
        "unsigned char start_state", state.tobytes()
    )
    model += _array("size_t offsets", (offsets[field] for field in _PARAMETERS.values()))
    with TemporaryDirectory() as folder:
        library = Path(folder) / f"{_NAME}.so"
        (Path(folder) / "model.h").write_text(model)
        _run([
            compiler, "-std=c11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wl,-z,defs", f"-I{headers}", f"-I{folder}",
            "-o", str(library), str(_HERE / "fmi3.c"), str(_HERE / "unsupported.c"),
            str(_object_file(bool(params[0].disturbed), samples)), "-lm",
        ])  # fmt: skip
        with replacing(out) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            start_values = [float(params[0][field]) for field in _PARAMETERS.values()]
            archive.writestr(
                "modelDescription.xml",
                _description(rig.name, token, defines, start_values, bool(params[0].force_driven)),
            )
            archive.write(library, f"binaries/{_PLATFORM}/{_NAME}.so")
    return Exported(str(out), rig.name, out.stat().st_size, block_s)


def _array(declaration: str, values: Iterable[int]) -> str:
    return f"static const {declaration}[] = {{{','.join(map(str, values))}}};\n"


def _headers() -> Path:
    package = importlib.util.find_spec("fmpy")
    if package is None or not package.submodule_search_locations:
        raise Fault("MISSING_EXTRA", f"fmpy: has the headers of FMI: must be installed; {install('fmi')}")
    return Path(package.submodule_search_locations[0]) / "c-code"


def _compiler() -> str:
    names = [os.environ["CC"]] if os.environ.get("CC") else ["cc", "gcc", "clang"]
    compiler = next((name for name in names if shutil.which(name)), None)
    if compiler is None:
        raise Fault("CONFIG", f"{', '.join(names)}: no such command: an FMU needs a C compiler; install gcc, or set CC")
    return compiler


def _object_file(disturbed: bool, samples: int) -> Path:
    """The kernel as machine code, compiled once for a version of the sources: 8 s of CPU, with effects 15 s."""
    kernel = "disturbed" if disturbed else "nominal"
    digest = "".join(sources_digest(_HERE.parent / name) for name in ("core.py", "records.py"))
    path = usable_folder() / f"fmu-{kernel}-{samples}-{digest}.o"
    if not path.exists():
        part = path.with_suffix(f".{os.getpid()}.part")
        _run([sys.executable, "-P", "-m", "plant.fmu.object_code", kernel, str(samples), str(part)])
        part.replace(path)
    return path


def _run(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Fault("CONFIG", f"{words[0]}: ended with status {done.returncode}: {done.stderr.strip()[-2000:]}")


def _description(name: str, token: str, defines: Mapping[str, Any], start_values: list[float], is_pulled: bool) -> str:
    """The file modelDescription.xml; the value references are as in fmi3.c."""
    root = Xml.Element(
        "fmiModelDescription", fmiVersion="3.0", modelName=name, instantiationToken=token, version=version("stickslip"),
        description="A slide that is pulled through a compliant drive, on a base that an exciter vibrates",
        generationTool="stickslip", variableNamingConvention="structured",
    )  # fmt: skip
    step = str(defines["BLOCK_S"])
    Xml.SubElement(
        root, "CoSimulation", modelIdentifier=_NAME, canGetAndSetFMUState="true", canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="false", fixedInternalStepSize=step,
    )  # fmt: skip
    inputs = {
        "pull_N" if is_pulled else "drive_velocity_mps": str(defines["START_DRIVE_MPS"]),
        "frequency_Hz": str(defines["START_FREQUENCY_HZ"]),
        "amplitude_m": "0",
        "load": "1",
    }
    outputs = [*CHANNELS, *TRUTH]
    units = Xml.SubElement(root, "UnitDefinitions")
    for unit in sorted({unit_of(name) for name in [*inputs, *outputs, *_PARAMETERS, "t_s"]} - {"", "1"}):
        Xml.SubElement(units, "Unit", name=unit)
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=step)
    variables = Xml.SubElement(root, "ModelVariables")
    rows: list[tuple[str, str, str, str | None]] = [("time", "independent", "continuous", None)]
    rows += [(name, "input", "discrete", value) for name, value in inputs.items()]
    rows += [(name, "output", "discrete", None) for name in outputs]
    rows += [(name, "parameter", "tunable", repr(value)) for name, value in zip(_PARAMETERS, start_values, strict=True)]
    structure = Xml.SubElement(root, "ModelStructure")
    for reference, (variable, causality, variability, value) in enumerate(rows):
        words = {"name": variable, "valueReference": str(reference), "causality": causality, "variability": variability}
        unit = "s" if variable == "time" else unit_of(variable)
        words |= ({"unit": unit} if unit not in {"", "1"} else {}) | ({"start": value} if value is not None else {})
        element = Xml.SubElement(variables, "Float64", words)
        if causality == "output":
            Xml.SubElement(element, "Dimension", start=str(defines["SAMPLES"]))
            Xml.SubElement(structure, "Output", valueReference=str(reference))
    for row in range(len(rows) - len(_PARAMETERS) - len(outputs), len(rows) - len(_PARAMETERS)):
        Xml.SubElement(structure, "InitialUnknown", valueReference=str(row))
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
