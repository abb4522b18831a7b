"""`python -m bridge.fmu.object_code MODULE VARIANT SAMPLES FILE.o`: a kernel as machine code that needs no Python.

A separate process: the code is for any x86-64 processor, and plain numba compiles the kernel with its callees, as a kernel
that `bridge.kernel_linking` links by address would hold addresses of this process.
"""

import importlib
import os
import sys
from pathlib import Path
from typing import Any

NAME = "stickslip_kernel"


def make(module: str, variant: str, samples: int, out: Path) -> None:
    """Write the object file of `int NAME(record, ...)`, which returns whether the state has become NaN."""
    os.environ["NUMBA_CPU_NAME"], os.environ["NUMBA_CPU_FEATURES"] = "generic", ""
    import numba
    from llvmlite import binding

    import bridge.kernel

    kernels: Any = bridge.kernel
    plain: Any = numba.njit(error_model="numpy", fastmath=False)
    kernels.kernel = kernels.shared_kernel = plain  # before the kernels are imported
    kernels.hypot = plain(kernels.hypot.py_func)
    layouts, function = importlib.import_module(module).compiled(variant, samples)
    pointer = numba.types.CPointer
    made: Any = numba.cfunc(numba.types.int32(*(pointer(numba.from_dtype(layout)) for layout in layouts)))(function)
    parsed = binding.parse_assembly(made.inspect_llvm().replace(made.native_name, NAME))
    target = binding.Target.from_triple("x86_64-unknown-linux-gnu")
    machine = target.create_target_machine(cpu="x86-64", opt=3, reloc="pic", codemodel="default")
    out.write_bytes(machine.emit_object(parsed))


if __name__ == "__main__":
    make(sys.argv[1], sys.argv[2], int(sys.argv[3]), Path(sys.argv[4]))
