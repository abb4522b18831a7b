"""Writes a kernel as an FMU: constants for C, the shared library and the model description, in one archive."""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from bridge.faults import Fault, install
from bridge.files import replacing
from bridge.fmu.description import description
from bridge.fmu.model import Model, Variable
from bridge.kernel_cache import ROOT, sources_digest, usable_folder

_HERE = Path(__file__).parent
_LIBRARY = "stickslip"
_PLATFORM = {2: "linux64", 3: "x86_64-linux"}  # by version of FMI


class Exported(NamedTuple):
    """An FMU."""

    fmu: str  # its file
    model: str
    fmi: int
    size_bytes: int
    step_s: float  # of the master

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        size = f"{self.size_bytes / 1000:.0f} kB, FMI {self.fmi}.0, Linux on x86-64"
        return [f"fmu      {self.fmu}: {self.model}, {size}; step {self.step_s * 1e3:g} ms"]


def export(model: Model, out: Path, fmi: int = 3) -> Exported:
    """Write the FMU of a model for FMI 2 or 3.

    Raises Fault CONFIG without a C compiler, MISSING_EXTRA without the headers of FMI, LOG_WRITE.
    """
    headers, compiler = _headers(), _compiler()
    model = model if fmi > 2 else model.without_arrays()
    code = _object_file(model)
    token = f"{{{uuid.UUID(hashlib.sha256(model.memory + code.name.encode()).hexdigest()[:32])}}}"
    with TemporaryDirectory() as folder:
        library = Path(folder) / f"{_LIBRARY}.so"
        (Path(folder) / "model.h").write_text(_constants(model, token))
        _run([
            compiler, "-std=c11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-Wl,-z,defs", f"-DFMI={fmi}",
            f"-I{headers}", f"-I{folder}", "-o", str(library), str(_HERE / f"fmi{fmi}.c"), str(_HERE / "unsupported.c"),
            str(code), "-lm",
        ])  # fmt: skip
        with replacing(out) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", description(model, fmi, _LIBRARY, token))
            archive.write(library, f"binaries/{_PLATFORM[fmi]}/{library.name}")
    return Exported(str(out), model.name, fmi, out.stat().st_size, model.step_s)


def _constants(model: Model, token: str) -> str:
    """The file model.h."""
    memory, places = model.memory, model.places()
    rows = model.rows
    defines = {
        "MEMORY_BYTES": len(memory), "STEP_S": repr(model.step_s), "MOST_STEPS": model.most_steps, "TOKEN": f'"{token}"',
        "VARIABLES": len(rows), "KERNEL(m)": f"stickslip_kernel({', '.join(f'(m) + {at}' for at in places)})",
    }  # fmt: skip
    text = "".join(f"#define {name} {value}\n" for name, value in defines.items())
    text += f"int stickslip_kernel({', '.join(['void *'] * len(places))});\n"
    text += _array("unsigned char start", map(str, memory))
    return text + _array("Variable variables", (f"{{{v.at}, {v.length}, {v.type}, {_access(v)}}}" for v in rows))


def _access(v: Variable) -> str:
    if v.causality in {"output", "independent"}:
        return "MEAN" if v.is_mean else "OUTPUT"
    return "FINITE" if v.type == "Float64" and v.length == 1 else "INPUT"


def _array(declaration: str, values: Iterable[str]) -> str:
    return f"static const {declaration}[] = {{{','.join(values)}}};\n"


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


def _object_file(model: Model) -> Path:
    """The kernel as machine code, compiled once for a version of the sources: 8 s of CPU of a rig, with effects 15 s."""
    source = ROOT.joinpath(*model.module.split(".")).with_suffix(".py")
    digest = sources_digest(source) + sources_digest(_HERE / "object_code.py")
    path = usable_folder() / f"{model.module}-{model.variant}-{model.samples}-{digest}.o"
    if not path.exists():
        part = path.with_suffix(f".{os.getpid()}.part")
        words = [model.module, model.variant, str(model.samples), str(part)]
        _run([sys.executable, "-P", "-m", "bridge.fmu.object_code", *words])
        part.replace(path)
    return path


def _run(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Fault("CONFIG", f"{words[0]}: ended with status {done.returncode}: {done.stderr.strip()[-2000:]}")
