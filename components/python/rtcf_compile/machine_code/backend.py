"""The differences of LLVM and numba between the releases of Debian.

Debian 12: numba 0.56 on LLVM 14 with typed pointers. Debian 13: numba 0.61 on LLVM 19 with opaque
pointers and another pass manager. Other modules do not depend on the release.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import llvmlite.binding as llvm
import numba
from numba import types
from numba.core import cgutils, codegen, compiler_machinery, config, cpu
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.typing import npydecl

# Options for functions that need no wrappers for calls from Python or C.
NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
POINTERS_HAVE_TYPES = llvm.llvm_version_info[0] < 15
_INLINED = 1000  # inlining threshold
_POINTER = re.compile(r"(?:i\d+|float|double|\[\d+ x i\d+\])\*+")
_RECORD_AND_EXCEPTION = (
    r"\(i8\*\*[^,]*, (?P<exception>\{[^}]*\})\*\*[^,]*, (?P<record>\[[^\]]*\]\*)"
)

# With this attribute, both versions of numba support arrays of bools in records.
types.Boolean.bitwidth = 8
# numba optimises each function on its own. Loops become vectors only in whole hooks, where sizes
# are known: before that, vectors would multiply the code and hide the sizes.
config.LOOP_VECTORIZE = config.SLP_VECTORIZE = 0
# Before each pass numba prints its options, for listeners that rtcf does not have: 7 % of the time.
compiler_machinery.pformat = lambda _: ""
if POINTERS_HAVE_TYPES:
    llvm.initialize()
llvm.initialize_native_target()
llvm.initialize_native_asmprinter()


_OWN = "rtcf_own"
_optimise = codegen.CPUCodeLibrary._optimize_final_module
_types_in_place = npydecl.NumpyRulesInplaceArrayOperator.generic


def _in_place(template: Any, args: Any, kws: Any) -> Any:
    """Return the signature of an in-place operator, or None.

    For types without one, numba 0.61 raises AttributeError, which hides its own error message.
    """
    try:
        return _types_in_place(template, args, kws)
    except AttributeError:
        return None


_make_constant_array = cpu.CPUContext.make_constant_array


def _constant_array(context: Any, *arguments: Any) -> Any:
    """Return a constant array, whose elements are in the code.

    Of a large array, numba's code otherwise contains the address in this process.
    """
    with mock.patch.object(cpu.CPUContext, "allow_dynamic_globals", False):
        return _make_constant_array(context, *arguments)


def initialise() -> None:
    """Load what numba otherwise loads when it compiles the first function."""
    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()


def _moved(builder: Any, pointer: Any, offset: Any, return_type: Any = None) -> Any:
    """Return a pointer moved by some bytes; replaces numba's cgutils.pointer_add.

    numba adds to an int, which hides from LLVM what the pointer refers to: two columns of a matrix
    might then share elements.
    """
    if isinstance(offset, int):
        offset = cgutils.intp_t(offset)
    moved = builder.gep(builder.bitcast(pointer, cgutils.voidptr_t), [offset])
    return builder.bitcast(moved, return_type or pointer.type)


def mark_own(library: Any, function: str) -> None:
    """Mark the code of a function of the user, which is optimised as a part of its hooks."""
    vars(library)[_OWN] = function


def _optimise_library(library: Any) -> None:
    """Optimise the functions of a library, as numba does, or simplify a function of the user."""
    own = vars(library).get(_OWN)
    if own is None:
        _optimise(library)
    else:
        _simplify(library._final_module, own)


def _simplify(module: Any, name: str) -> None:
    """Simplify one function, so that its calls have constant arguments where possible."""
    function = module.get_function(name)
    if not POINTERS_HAVE_TYPES:
        passes_builder = _builder(vectors=False)
        passes_builder.getFunctionPassManager().run(function, passes_builder)
        return
    passes = llvm.FunctionPassManager(module)
    target = machine()
    target.add_analysis_passes(passes)
    passes.add_sroa_pass()
    passes.add_cfg_simplification_pass()
    passes.add_instruction_combining_pass()
    passes.add_gvn_pass()
    passes.add_sccp_pass()
    passes.add_cfg_simplification_pass()
    passes.add_refprune_pass()
    passes.initialize()
    passes.run(function)
    passes.finalize()


@contextmanager
def not_to_run() -> Iterator[None]:
    """Make numba compile functions to assembly only.

    Loading machine code into this process would take longer than optimising it. Python cannot call
    the functions.
    """

    def executable(context: Any, library: Any, description: Any, environment: Any) -> Any:
        name = description.qualname.split(".")[-1]
        module = description.lookup_module()
        return cpu._dynfunc.make_function(module, name, "", 0, environment, (library,))

    from rtcf_compile.machine_code.raised_values import check_bounds

    with (
        mock.patch.object(cgutils, "do_boundscheck", check_bounds),
        mock.patch.object(cpu.CPUContext, "make_constant_array", _constant_array),
        mock.patch.object(cgutils, "pointer_add", _moved),
        mock.patch.object(cpu.CPUContext, "get_executable", executable),
        mock.patch.object(codegen.JITCPUCodegen, "_add_module", lambda self, module: None),
        mock.patch.object(codegen.JITCodeLibrary, "_finalize_specific", lambda self: None),
        mock.patch.object(codegen.CPUCodeLibrary, "_optimize_final_module", _optimise_library),
        mock.patch.object(npydecl.NumpyRulesInplaceArrayOperator, "generic", _in_place),
    ):
        yield


def bitcode(library: Any) -> bytes:
    """Return the code of a library.

    From now on the library uses the code that another run reads: the order in which LLVM keeps uses
    of a value differs, and so would the results of optimisation.
    """
    code: bytes = library.serialize_using_bitcode()[2]
    library._final_module, library._shared_module = llvm.parse_bitcode(code), None
    return code


def assembly_of(library: Any) -> str:
    """Return the assembly of functions that numba has compiled, including their callees."""
    with not_to_run(), global_compiler_lock:
        library._ensure_finalized()
    text: str = library.get_llvm_str()
    return text


def parsed(assembly: str) -> Any:
    """Return the module of an assembly."""
    return llvm.parse_assembly(assembly)


def pointers(assembly: str) -> str:
    """Convert our assembly, which has typed pointers, to the syntax of this LLVM."""
    return assembly if POINTERS_HAVE_TYPES else _POINTER.sub("ptr", assembly)


def taken(assembly: str, function: str) -> tuple[str, str]:
    """Return the parameter types of the record and of the exception in a function of numba."""
    form = _RECORD_AND_EXCEPTION if POINTERS_HAVE_TYPES else r"\(ptr [^,]*, ptr [^,]*, ptr "
    found = re.search(rf"^define [^\n]*@{re.escape(function)}{form}", assembly, re.M)
    if found is None:
        raise RuntimeError(f"numba {numba.__version__}: functions have a form not known here")
    return (found["record"], f"{found['exception']}**") if POINTERS_HAVE_TYPES else ("ptr", "ptr")


def drop_unused(module: Any) -> None:
    """Drop code that no external function needs."""
    if POINTERS_HAVE_TYPES:
        passes = llvm.ModulePassManager()
        passes.add_global_dce_pass()
        passes.run(module)
    else:
        passes = llvm.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(module, _builder())


def inline(module: Any) -> None:
    """Inline functions and simplify, without vectorising."""
    # The first run inlines, the second one uses the sizes that are constant then.
    _run(module, level=2)
    _run(module, level=3)


def optimise(module: Any) -> None:
    """Optimise a module as -O3 does, with more inlining."""
    _run(module, level=3, vectors=True)
    drop_unused(module)


def _run(module: Any, level: int, vectors: bool = False) -> None:
    if POINTERS_HAVE_TYPES:
        passes = llvm.ModulePassManager()
        builder = llvm.PassManagerBuilder()
        builder.opt_level = level
        builder.loop_vectorize = builder.slp_vectorize = vectors
        builder.inlining_threshold = _INLINED
        target = machine()  # the passes refer to it: keep it alive
        target.add_analysis_passes(passes)
        builder.populate(passes)
        passes.run(module)
    else:
        passes_builder = _builder(vectors, level)
        passes_builder.getModulePassManager().run(module, passes_builder)


def emitted(assembly: str) -> bytes:
    """Return the object file of assembly with only data and calls."""
    module = parsed(assembly)
    target = machine()
    module.triple, module.data_layout = target.triple, str(target.target_data)
    module.verify()
    return bytes(target.emit_object(module))


def machine() -> Any:
    """Return the target machine for any processor of this architecture."""
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu="generic", opt=3, reloc="pic", codemodel="default")


def _builder(vectors: bool = True, level: int = 3) -> Any:
    tuning = llvm.create_pipeline_tuning_options(speed_level=level)
    tuning.loop_vectorization = tuning.slp_vectorization = vectors
    tuning.inlining_threshold = _INLINED
    return llvm.create_pass_builder(machine(), tuning)
