"""Compiled kernels on disk, under names that say all that they depend on (``tilestamp.models.kernel``)."""

import contextlib
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite.binding import add_symbol, parse_assembly, parse_bitcode
from numba import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.runtime import _nrt_python

from tilestamp.models.compile_cache import cache_folder, note_compiled, note_compiling, note_missing
from tilestamp.models.kernel_digest import kernel_digest
from tilestamp.models.kernel_files import KernelFiles
from tilestamp.models.kernel_library import KernelLibrary, environments, for_kernels, gathers, nested, no_address

_UNREADABLE = (  # of pickle, whatever its bytes happen to say, and of LLVM
    *(OSError, EOFError, pickle.UnpicklingError, AttributeError, ImportError, ArithmeticError, LookupError),
    *(MemoryError, RuntimeError, TypeError, ValueError),
)


class _Locator(_CacheLocator):  # type: ignore[misc]  # numba has no types
    """Where one kernel is kept: all in one folder, the digest in the file's name."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_file = function.__code__.co_filename  # numba asks for it when it cannot cache
        self._digest = kernel_digest(function)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        """Nothing more than the file's name says."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Return what the file's name ends with."""
        return self._digest

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], _py_file: str) -> "_Locator":
        """Find the place of a kernel."""
        return cls(py_func)


class _Impl(CompileResultCacheImpl):  # type: ignore[misc]
    """As Numba writes compiled functions, elsewhere."""

    _locator_classes = (_Locator,)

    def reduce(self, cres: Any) -> Any:
        """Serialize, without the environments of Numba's own functions that hold nothing: each loads its module."""
        if for_kernels(cres.library):
            return self._reduce_for_kernels(cres)
        if not gathers():
            return super().reduce(cres)
        *all_else, needed = super().reduce(cres)
        return (*all_else, list(filter(_worth_keeping, needed)))

    def _reduce_for_kernels(self, cres: Any) -> Any:
        """Serialize what only kernels call, and all that it calls, as bitcode."""
        cres.fndesc.typemap = cres.fndesc.calltypes = None
        name, kind, bitcode = cres.library.serialize()
        needed = list(filter(_worth_keeping, environments(parse_bitcode(bitcode))))
        described = cres.fndesc, cres.environment, cres.signature, False, (), "", cres.reload_init
        return ((name, kind, bitcode), *described, needed)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Load the machine code alone; its bitcode waits until another kernel is compiled against it."""
        if not gathers():
            return super().rebuild(target_context, payload)
        (name, kind, code), described, *rest = payload
        if kind == "bitcode":
            return self._rebuild_for_kernels(target_context, payload)
        engine = target_context.codegen()._engine  # noqa: SLF001
        engine._defined_symbols.add(described.llvm_cpython_wrapper_name)  # noqa: SLF001 - by which it is found
        machine_code, bitcode = code
        nothing = parse_assembly("").as_bitcode()
        found = super().rebuild(target_context, ((name, kind, (machine_code, nothing)), described, *rest))
        found.library.__class__ = _LoadedLibrary
        found.library.bitcode = bitcode
        return found

    def _rebuild_for_kernels(self, target_context: Any, payload: Any) -> Any:
        (name, _, bitcode), described, environment, signature, _, _, _, reload_init, needed = payload
        return CompileResult(
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=no_address(),
            library=KernelLibrary.from_bitcode(target_context.codegen(), name, bitcode),
            fndesc=described,
            environment=environment,
            signature=signature,
            objectmode=False,
            lifted=(),
            typing_error=None,
            type_annotation="",
            call_helper=None,
            metadata=None,
            reload_init=reload_init,
            referenced_envs=needed,
        )


class _LoadedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Machine code from disk, with bitcode that few need: to read it takes as long as to load the machine code."""

    bitcode: bytes | None

    def _get_module_for_linking(self) -> Any:
        if self.bitcode is not None:
            self._shared_module, self.bitcode = parse_bitcode(self.bitcode), None
            self._codegen._engine._load_defined_symbols(self._shared_module)  # noqa: SLF001
        return super()._get_module_for_linking()


@cache
def _find_memory_manager() -> None:
    """Tell LLVM where Numba's functions in C are; those that Numba compiles beside them each kernel holds itself."""
    for name, address in _nrt_python.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _worth_keeping(environment: Any) -> bool:
    return environment.can_cache() and (environment.consts or not environment.globals["__name__"].startswith("numba."))


class KernelCache(FunctionCache):  # type: ignore[misc]
    """The cache of one kernel; it is looked for at the first call, when all that the kernel reaches is defined."""

    _impl_class = _Impl

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._found = False

    def _find(self) -> None:
        if not self._found:
            super().__init__(self._dispatcher.py_func)
            self._cache_file = KernelFiles(self._cache_path, self._impl.filename_base)
            self._found = True

    @property
    def cache_path(self) -> str:
        """The folder."""
        self._find()
        return str(self._cache_path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load what was compiled for the signature, None if it was not; a file that cannot be read is none.

        Numba would first load all that it can compile (``target_context.refresh``), which takes longer than a small
        frame: what is on disk needs the functions in C of its memory manager alone.
        """
        self._find()
        if gathers():
            _find_memory_manager()
        else:
            target_context.refresh()
        found = self._readable(sig, target_context)
        if found is None and not nested():
            note_missing()
            self.claim(sig, target_context)
            found = self._readable(sig, target_context)
        if found is None:
            target_context.refresh()
            note_compiling(self._dispatcher.py_func)
        return found

    def claim(self, sig: Any, target_context: Any, *patience: float) -> bool:
        """``KernelFiles.claim`` for a signature."""
        self._find()
        return self._cache_file.claim(self._index_key(sig, target_context.codegen()), *patience)

    def _readable(self, sig: Any, target_context: Any) -> Any:
        try:
            return self._load_overload(sig, target_context)
        except _UNREADABLE:
            with contextlib.suppress(OSError):
                self._cache_file.path(self._index_key(sig, target_context.codegen())).unlink()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled; where nothing can be written it is not kept."""
        self._find()
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)
        note_compiled()

    def flush(self) -> None:
        """Forget what was compiled."""
        self._find()
        super().flush()

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """As Numba's, with the options and with the names and order of the fields of what is passed in."""
        options = sorted((name, str(value)) for name, value in self._dispatcher.targetoptions.items())
        called_by = ("counters seen", "kernels") if nested() else ("counters seen",)
        return (*super()._index_key(sig, codegen), str(options), _fields(sig), *called_by)


def _fields(sig: Any) -> str:
    """Home and fields of the named tuples among some types: a kernel reads a field by its place."""
    named = [
        (t.instance_class.__module__, str(t), t.fields, _fields(t.types))
        for t in sig
        if isinstance(t, types.BaseNamedTuple)
    ]
    return str(named) if named else ""
