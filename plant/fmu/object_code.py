"""`python -m plant.fmu.object_code nominal|disturbed SAMPLES FILE.o`: the plant's kernel as machine code that needs no Python.

A separate process: the code is for any x86-64 processor, and plain numba compiles the kernel with its callees, as a kernel
that `bridge.kernel_linking` links by address would hold addresses of this process.
"""

import os
import sys
from pathlib import Path
from typing import Any

NAME = "stickslip_block"


def make(disturbed: bool, samples: int, out: Path) -> None:
    """Write the object file of `NAME(params, state, drive, frequency_Hz, amplitude_m, analogue, truth)`."""
    os.environ["NUMBA_CPU_NAME"], os.environ["NUMBA_CPU_FEATURES"] = "generic", ""
    import numba
    from llvmlite import binding

    import bridge.kernel

    kernels: Any = bridge.kernel
    kernels.kernel = kernels.shared_kernel = numba.njit(
        error_model="numpy", fastmath=False
    )  # before the plant is imported
    from bridge.wire.channels import CHANNELS
    from plant.core import advance, advance_disturbed
    from plant.records import PARAMS, STATE, TRUTH

    step: Any = advance_disturbed if disturbed else advance
    double, channels, truths = numba.types.double, len(CHANNELS), len(TRUTH)
    carray: Any = vars(numba)["carray"]
    pointer = numba.types.CPointer
    params, state = pointer(numba.from_dtype(PARAMS)), pointer(numba.from_dtype(STATE))

    @numba.cfunc(numba.types.void(params, state, double, double, double, pointer(double), pointer(double)))
    def block(p: Any, s: Any, drive: float, frequency: float, amplitude: float, analogue: Any, truth: Any) -> None:
        step(
            carray(p, 1), carray(s, 1), drive, frequency, amplitude, carray(analogue, (channels, samples)),
            carray(truth, (truths, samples)),
        )  # fmt: skip

    module = binding.parse_assembly(block.inspect_llvm().replace(block.native_name, NAME))
    target = binding.Target.from_triple("x86_64-unknown-linux-gnu")
    machine = target.create_target_machine(cpu="x86-64", opt=3, reloc="pic", codemodel="default")
    out.write_bytes(machine.emit_object(module))


if __name__ == "__main__":
    make(sys.argv[1] == "disturbed", int(sys.argv[2]), Path(sys.argv[3]))
