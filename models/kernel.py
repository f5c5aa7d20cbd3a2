"""Kernels: functions that Numba compiles, kept on disk under a name that says all that they depend on.

Numba's own disk cache looks only at the file of the kernel itself: it is stale when a helper in another file changes,
and empty when a comment does. Here the name holds a digest of the kernel's bytecode and of all that it reaches: the
kernels that it calls, in whatever module, and the constants and enums that it reads. So an edit recompiles the kernels
whose code it changes, and no other; two checkouts share what they have in common.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import local
from typing import Any, Protocol, overload

from numba import config
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from tilestamp.models.compile_cache import compiling, interruptible
from tilestamp.models.compile_quicker import quicker
from tilestamp.models.kernel_cache import KernelCache
from tilestamp.models.kernel_files import release
from tilestamp.models.kernel_library import for_kernels, gathers, nested, outermost


class Kernel(Protocol):
    """A compiled function: what it takes and returns is known when it is called, so that it is untyped to mypy."""

    py_func: Callable[..., Any]

    def __call__(self, *args: Any) -> Any:
        """Call it, compiled for these types."""


@overload
def kernel(function: Callable[..., Any]) -> Kernel: ...
@overload
def kernel(
    *, error_model: str = ..., lent: bool = ..., inline: bool = ...
) -> Callable[[Callable[..., Any]], Kernel]: ...
def kernel(
    function: Callable[..., Any] | None = None,
    *,
    error_model: str = "python",
    lent: bool = False,
    inline: bool = False,
) -> Kernel | Callable[[Callable[..., Any]], Kernel]:
    """Compile a function where it is first called; it releases the GIL, and what was compiled is kept on disk.

    Parameters
    ----------
    function : callable
    error_model : {"python", "numpy"}
        ``"numpy"``: a division by zero gives inf or nan instead of an error.
    lent : bool
        The arrays that it takes are the caller's, and it makes and returns none: then compiled code counts no
        references to them.
        Counting calls a function twice for each array (of a tuple, too) of each call, more than a small kernel's work.
    inline : bool
        Its code is copied to where it is called: of a kernel that works for less time than its arguments take to pass.
    """

    def compiled(function: Callable[..., Any]) -> Kernel:
        if config.DISABLE_JIT:
            return function  # type: ignore[return-value]  # which is its own py_func
        options = {"nopython": True, "nogil": True, "error_model": error_model, "boundscheck": None}
        options |= {"_nrt": not lent, "forceinline": inline}
        return _Dispatcher(function, targetoptions=options)

    return compiled if function is None else compiled(function)


class _Dispatcher(CPUDispatcher):  # type: ignore[misc]  # numba has no types
    """Compiles a kernel for Python, or, called by another kernel, for kernels alone."""

    compiles_for_kernels = True

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self._cache = KernelCache(self)  # numba has no public way to name a cache

    def _compilation_chain_init_hook(self) -> None:
        """Look for no extensions of Numba in all that is installed: no kernel of ours takes or calls what they add."""

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled, where Python finds it if it may call it."""
        returned = self.targetctx.data_model_manager[cres.signature.return_type]
        if not self.targetoptions["_nrt"] and returned.contains_nrt_meminfo():  # it would be freed once too often
            raise TypeError(f"{self.py_func.__name__} returns an array, which is lent to it")
        if for_kernels(cres.library):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)

    def compile(self, sig: Any) -> Any:
        """Compile it, or load it."""
        with global_compiler_lock, compiling():
            if nested() or not gathers():
                return super().compile(sig)
            types_given = tuple(normalize_signature(sig)[0])
            known = self.overloads.get(types_given)
            if known is not None and for_kernels(known.library):
                del self.overloads[types_given]
            try:
                with interruptible(), quicker(), outermost(self.targetctx.codegen()):
                    return super().compile(sig)
            finally:
                release()

    def claim(self, types_given: Any) -> bool:
        """Whether it is left to this process to compile it for some types: nobody else does so now."""
        return self._cache.claim(types_given, self.targetctx, 0.0)


@contextmanager
def interpreted() -> Iterator[dict[tuple[Any, Any], None]]:
    """Run kernels as the Python that they are; found are those that Python calls, each with types of what it gives."""
    calls: dict[tuple[Any, Any], None] = {}
    inside = local()

    def call(kernel: Any, *args: Any) -> Any:
        outer = not getattr(inside, "kernel", False)
        if outer:
            calls[kernel, tuple(map(kernel.typeof_pyval, args))] = None
            inside.kernel = True
        try:
            return kernel.py_func(*args)
        finally:
            if outer:
                inside.kernel = False

    _Dispatcher.__call__ = call
    try:
        yield calls
    finally:
        del _Dispatcher.__call__
