"""How kernels become machine code: all that an entry calls is optimised and translated once, together with it.

Numba by itself optimises every function with all that it calls and makes machine code of it, although only an entry is
ever run by itself: a function ten calls down was optimised ten times. Here a part is only lowered.
"""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import binding
from numba.core import config
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, CompileResult


class _NoMachineCode:
    """The code generator of a part: no environment is set in machine code that there is not."""

    def __init__(self, codegen: JITCPUCodegen) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> object:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: object) -> None:
        """Nothing: a part calls no Python, and raises nothing."""


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    @property
    def codegen(self) -> _NoMachineCode:
        return _NoMachineCode(self._codegen)

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, _: str) -> int:
        """There is none."""
        self._ensure_finalized()
        return 0


class _EntryLibrary(JITCodeLibrary):  # type: ignore[misc]
    def _optimize_final_module(self) -> None:
        """The loops are over a few states and inputs: to unroll them takes time, and gains none."""
        options = binding.create_pipeline_tuning_options(speed_level=int(config.OPT))
        options.loop_unrolling = options.loop_vectorization = options.slp_vectorization = False
        builder = binding.create_pass_builder(self._codegen._tm, options)
        builder.getModulePassManager().run(self._final_module, builder)


class PartCompiler(Compiler):  # type: ignore[misc]
    """The compiler of kernels that only kernels call."""

    def compile_extra(self, function: Callable[..., object]) -> CompileResult:
        """Lowers a function."""
        self.state.library = _PartLibrary(self.state.targetctx.codegen(), function.__qualname__)
        return super().compile_extra(function)


class EntryCompiler(Compiler):  # type: ignore[misc]
    """The compiler of kernels that Python calls."""

    def compile_extra(self, function: Callable[..., object]) -> CompileResult:
        """Makes machine code of a function and of all that it calls."""
        library = self.state.library = _EntryLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.enable_object_caching()
        return super().compile_extra(function)
