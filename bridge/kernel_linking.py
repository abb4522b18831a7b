"""Compilation of kernels that call each other, each of them only once.

Numba optimises each function with all its callees, generates machine code and wrappers for Python and C, and caches them on disk.
Each caller repeats all of that, so a kernel six calls deep is optimised six times. Here a kernel that other kernels call is only
lowered to LLVM's representation: a part. The kernel that Python calls is optimised once, with all its parts. A shared kernel is
machine code that its callers call by address, like `math.sin`; no caller compiles it again.
From an empty cache the plant takes 15 s of CPU, 28 s with plain numba, 17 s without shared kernels. Plant, controller and both in
one process take 42 s, 81 s with plain numba (docs/decisions/31-kernels-are-linked-by-us.md).
"""

import copy
import functools
import hashlib
import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from llvmlite import binding
from numba.core import caching, compiler, types
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher

from bridge.compiling import compiling, expect, note_done
from bridge.kernel_cache import SourcesLocator, sources_digest

_OPTIONS = {"nopython": True, "boundscheck": None, "error_model": "numpy", "fastmath": False, "no_cfunc_wrapper": True}
_CPUDispatcher: Any = CPUDispatcher
_JITCodeLibrary: Any = JITCodeLibrary
_Compiler: Any = compiler.Compiler
_FunctionCache: Any = caching.FunctionCache


class _Cache(_FunctionCache):
    """Numba's cache on disk, with a key of all sources of a kernel.

    The key is not set in numba's configuration, which numba resets at the first compilation after a change of the environment:
    kernels defined later had a key without the sources that they import, and called kernels that no longer existed.
    """

    class _impl_class(_FunctionCache._impl_class):  # noqa: N801, SLF001 - numba's name
        _locator_classes = (SourcesLocator,)


class _Library(_JITCodeLibrary):
    """The code of a kernel that Python calls, with the parts that it links in, each once."""

    def add_linking_library(self, library: Any) -> None:
        if isinstance(library, _ByAddress):
            self._reload_init.add(library.load)
            return
        super().add_linking_library(library)
        if isinstance(library, _Part):
            self._linking_libraries += library._linking_libraries  # noqa: SLF001
            self._reload_init |= library._reload_init  # noqa: SLF001

    def finalize(self) -> None:
        super().finalize()
        for variable in self._final_module.global_variables:
            if (environment := lookup_environment(variable.name)) is not None:
                self._codegen.set_env(variable.name, environment)


class _Part(_Library):
    """The lowered code of a kernel that another kernel calls; the library that links it in optimises it."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True


class _ByAddress:
    """Placeholder for the code of a shared kernel: nothing is linked in, and the kernel is loaded before its callers."""

    def __init__(self, load: Callable[[], object]) -> None:
        self.load = load


class _WholeCompiler(_Compiler):
    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing, target, library or _Library(target.codegen(), "kernel"), *rest)
        self.state.library.enable_object_caching()

    def compile_extra(self, func: Any) -> Any:
        with compiling() as module:
            expect(_called_by(func) | (_kernels_in(module) if module else set()))
            return super().compile_extra(func)


class _PartCompiler(_Compiler):
    def __init__(
        self, typing: Any, target: Any, _library: Any, args: Any, returns: Any, flags: Any, names: Any
    ) -> None:
        flags.no_compile = flags.no_cpython_wrapper = True
        super().__init__(typing, target, _Part(target.codegen(), "kernel"), args, returns, flags, names)


class _Inner(_CPUDispatcher):
    """A kernel as other kernels call it: a part that they link in."""

    def add_overload(self, cres: Any) -> None:
        note_done({self.py_func})
        self.overloads[tuple(cres.signature.args)] = cres
        self.targetctx.insert_user_function(cres.library, cres.fndesc, [cres.library])

    def get_overload(self, sig: Any) -> Any:
        return self.overloads[tuple(sig)].library


# ruff: noqa: D102 - numba's own methods, as numba describes them
class Kernel(_CPUDispatcher):
    """A kernel: machine code, kept on disk, for Python; for other kernels a part of its caller."""

    def __init__(self, py_func: Any, unlocked: bool = False) -> None:
        super().__init__(py_func, targetoptions={**_OPTIONS, "nogil": unlocked}, pipeline_class=_WholeCompiler)
        self._cache = _Cache(py_func)
        self._inner = _Inner(py_func, targetoptions=dict(_OPTIONS), pipeline_class=_PartCompiler)

    def __reduce__(self) -> Any:
        # a part of the cache's key of a kernel that holds this one in its closure: the content, not numba's number of the process
        path = Path(inspect.getfile(self.py_func)).resolve()
        return _kernel, (self.py_func.__module__, self.py_func.__qualname__, sources_digest(path))

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self._inner.get_call_template(*_of_any_value(args, kws))

    def get_overload(self, sig: Any) -> Any:
        return self._inner.get_overload(sig)


class SharedKernel(_CPUDispatcher):
    """A kernel that is machine code both for Python and for other kernels."""

    def __init__(self, py_func: Any) -> None:
        super().__init__(py_func, targetoptions=dict(_OPTIONS), pipeline_class=_WholeCompiler)
        self._cache = _Cache(py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template(*_of_any_value(args, kws))

    def add_overload(self, cres: Any) -> None:
        note_done(_called_by(self.py_func))
        super().add_overload(cres)
        self.targetctx.remove_user_function(cres.entry_point)
        args, function = cres.signature.args, self.py_func
        path = Path(inspect.getfile(function)).resolve()
        kind = hashlib.sha256(f"{args} {sources_digest(path)}".encode()).hexdigest()[:16]
        named = copy.copy(cres.fndesc)
        named.mangled_name = f"stickslip.{function.__module__}.{function.__qualname__}.{kind}"
        binding.add_symbol(named.mangled_name, cres.library.get_pointer_to_function(cres.fndesc.llvm_func_name))
        load = functools.partial(_load, function.__module__, function.__qualname__, args)
        self.targetctx.insert_user_function(cres.entry_point, named, [_ByAddress(load)])


def _called_by(function: Any) -> set[object]:
    """The functions of a kernel and of all kernels below it in the call tree; found by their names."""
    functions, ahead = set[object](), [function]
    while ahead:
        caller = ahead.pop()
        functions.add(caller)
        names = caller.__code__.co_names
        values = [caller.__globals__.get(name) for name in names]
        values += [cell.cell_contents for cell in caller.__closure__ or ()]
        modules = [value for value in values if inspect.ismodule(value)]
        values += [getattr(module, name, None) for module in modules for name in names]
        ahead += [value.py_func for value in values if isinstance(value, _KINDS) and value.py_func not in functions]
    return functions


def _of_any_value(args: Any, kws: Any) -> tuple[Any, Any]:
    """Types of arguments without the literal values of the caller: numba would compile a kernel for each value."""
    return tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()}


_KINDS = (Kernel, SharedKernel)


def _kernels_in(module: str) -> set[object]:
    """The functions of the kernels that a module defines or imports, and of the kernels that these call."""
    entries = [value.py_func for value in vars(importlib.import_module(module)).values() if isinstance(value, _KINDS)]
    return set[object]().union(*map(_called_by, entries))


def _kernel(module: str, name: str, _digest: str) -> Any:
    return getattr(importlib.import_module(module), name)


def _load(module: str, name: str, args: tuple[Any, ...]) -> None:
    """Load or compile a shared kernel before its callers are loaded."""
    getattr(importlib.import_module(module), name).compile(args)
