"""What a kernel calls is optimised and made machine code once, in the kernels that Python calls.

Of every function that it compiles, each helper and each of its own, Numba makes machine code and two wrappers for
Python, and optimises it anew in all that call it. Here such a function stays as it was lowered (``KernelLibrary``)
until the outermost kernel gathers what it reaches, each once, optimises that together and makes machine code of it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from llvmlite.binding import create_new_function_pass_manager, parse_bitcode
from numba.core import event
from numba.core.codegen import JITCodeLibrary
from numba.core.cpu import CPUContext
from numba.core.environment import lookup_environment

TRIED = ("0.68",)  # versions of Numba whose private parts are known here
COUNTERS = "NRT_incref", "NRT_decref"  # of references: Numba leaves out what cancels, and knows them by name
_CALLED_BY_KERNELS = ("numba", __name__.split(".")[0])  # stand-ins for functions, of Numba and of ours
_outermost: list["_Nesting"] = []  # of the kernel that is being compiled for Python, under Numba's compiler lock


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """Code of one function, without what it calls until it is finalised."""

    for_python = False
    _linking_libraries: list[Any]
    _own: Any = None

    @classmethod
    def from_bitcode(cls, codegen: Any, name: str, bitcode: bytes) -> "KernelLibrary":
        """Take what ``serialize`` gave."""
        library = cls(codegen, name)
        library._final_module = parse_bitcode(bitcode)
        return library

    def serialize(self) -> tuple[str, str, bytes]:
        """Its bitcode, with all that it calls."""
        whole = self._own_module().clone()
        self._link_into(whole, COUNTERS)
        return self.name, "bitcode", whole.as_bitcode()

    def add_linking_library(self, library: Any) -> None:
        """Note what is called, finalised or not."""
        self._linking_libraries.append(library)

    @property
    def has_dynamic_globals(self) -> bool:
        """No kernel has any: what is not known when it is compiled is an argument."""
        return False

    def finalize(self) -> None:
        """Gather what is reached, optimise it together and make machine code."""
        self._link_into(self._final_module)
        self._linking_libraries = []
        super().finalize()
        for environment in environments(self._final_module):
            self._codegen.set_env(environment.env_name, environment)

    def _optimize_functions(self, module: Any) -> None:
        """Make each function small, as it is kept and linked; Numba would optimise it as far as it goes by itself."""
        codegen, passes = self._codegen, create_new_function_pass_manager()
        module.data_layout, builder = codegen._data_layout, codegen._pass_builder()  # noqa: SLF001
        passes.add_sroa_pass()
        passes.add_instruction_combine_pass()
        for name in _defined(module):
            passes.run(module.get_function(name), builder)

    def _optimize_final_module(self) -> None:
        """Optimise once; Numba does so twice, for a better chance to drop counts of references."""
        passes, builder = self._codegen._module_pass_manager()  # noqa: SLF001
        passes.run(self._final_module, builder)

    def _link_into(self, module: Any, seen_by_all: tuple[str, ...] = ()) -> None:
        """Add what is reached, each function once, and hide it: names are unique in one process alone."""
        own = set(_defined(module))
        seen, left, finished = {id(self)}, list(self._linking_libraries), []
        while left:
            library = left.pop(0)
            if id(library) in seen:
                continue
            seen.add(id(library))
            self._reload_init.update(library._reload_init)  # noqa: SLF001
            if isinstance(library, KernelLibrary) and not library._finalized:  # noqa: SLF001
                left += library._linking_libraries  # noqa: SLF001
                module.link_in(library._own_module(), preserve=True)  # noqa: SLF001
            else:
                finished.append(library)
        for library in finished:  # last: of a finished one LLVM takes only what is called by then
            module.link_in(library._get_module_for_linking(), preserve=True)  # noqa: SLF001
        for name in _defined(module):
            if name not in own and name not in seen_by_all:
                module.get_function(name).linkage = "internal"

    def _own_module(self) -> Any:
        """Its code as others may link it, several times; weak, since of ``linkonce`` only what is called is taken.

        What is called may come later: another that calls it, of which this one is no longer looked at.
        """
        if self._own is None:
            self._own = self._final_module.clone()
            for function in self._own.functions:
                if not function.is_declaration and function.linkage.name == "external":
                    function.linkage = "weak_odr"
        return self._own


def _defined(module: Any) -> list[str]:
    return [function.name for function in module.functions if not function.is_declaration]


def environments(module: Any) -> list[Any]:
    """What functions of a module need of Python."""
    names = [variable.name for variable in module.global_variables if variable.name.startswith("_ZN08NumbaEnv")]
    return [found for found in map(lookup_environment, names) if found is not None]


def for_kernels(library: Any) -> bool:
    """Whether what was compiled can be called by kernels alone."""
    return isinstance(library, KernelLibrary) and not library.for_python


def nested() -> bool:
    """Whether what is compiled or loaded now is for another kernel."""
    return bool(_outermost) and _outermost[-1].depth > 0


class _Nesting(event.Listener):  # type: ignore[misc]
    """Functions that are being compiled, each for the one before."""

    def __init__(self) -> None:
        self._dispatchers: list[Any] = []

    def on_start(self, event: Any) -> None:
        self._dispatchers.append(event.data["dispatcher"])

    def on_end(self, _event: Any) -> None:
        self._dispatchers.pop()

    @property
    def depth(self) -> int:
        return len(self._dispatchers)

    @property
    def for_python(self) -> bool:
        """Whether Python may call what is being compiled: the kernel, or what others had Numba compile."""
        return self.depth == 1 or not (self.kernel or _module(self._dispatchers[-1]) in _CALLED_BY_KERNELS)

    @property
    def kernel(self) -> bool:
        """Whether a kernel is being compiled."""
        return hasattr(self._dispatchers[-1], "compiles_for_kernels")


def _module(dispatcher: Any) -> str:
    name: str = dispatcher.py_func.__module__
    return name.split(".", maxsplit=1)[0]


def no_address() -> Any:
    """Stand for the address of a function that has none: Numba wants a built-in function, another for each."""
    return [].append


def gathers() -> bool:
    """Whether Numba's version has been tried; another compiles, keeps and loads each function by itself, as it does."""
    return str(numba.__version__).startswith(tuple(f"{version}." for version in TRIED))


@contextmanager
def outermost(codegen: Any) -> Iterator[None]:
    """Compile a kernel for Python, and what it calls for kernels alone; under Numba's compiler lock."""
    nesting = _Nesting()
    kept = {
        name: getattr(CPUContext, name) for name in ("get_executable", "create_cpython_wrapper", "create_cfunc_wrapper")
    }

    def get_executable(context: Any, library: Any, *described: Any) -> Any:
        if not (nesting.depth == 0 or nesting.for_python or library._finalized):  # noqa: SLF001 - it comes from disk
            return no_address()
        library.for_python = True
        return kept["get_executable"](context, library, *described)

    def create_cpython_wrapper(context: Any, *described: Any, **options: Any) -> None:
        if nesting.for_python:
            kept["create_cpython_wrapper"](context, *described, **options)

    def create_cfunc_wrapper(context: Any, *described: Any, **options: Any) -> None:
        """For C, which calls no kernel; of a function that others had Numba compile its address may be passed."""
        if nesting.for_python and not nesting.kernel:
            kept["create_cfunc_wrapper"](context, *described, **options)

    library_class = codegen._library_class  # noqa: SLF001
    event.register("numba:compile", nesting)
    _outermost.append(nesting)
    codegen._library_class = KernelLibrary  # noqa: SLF001
    for made in (get_executable, create_cpython_wrapper, create_cfunc_wrapper):
        setattr(CPUContext, made.__name__, made)
    try:
        yield
    finally:
        for name, method in kept.items():
            setattr(CPUContext, name, method)
        codegen._library_class = library_class  # noqa: SLF001
        _outermost.pop()
        event.unregister("numba:compile", nesting)
