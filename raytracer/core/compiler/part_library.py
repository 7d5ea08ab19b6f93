"""The LLVM code of one part of a kernel, to be linked into the entry that calls it."""

import functools
import hashlib
import re
from typing import Any

import llvmlite.binding as llvm
from numba.core.cgutils import normalize_ir_text
from numba.core.codegen import CodeLibrary, CPUCodeLibrary
from numba.core.registry import cpu_target

_LINKED_ONCE = "linkonce_odr"

_ENVIRONMENT = re.compile(r'^@"?([^"\s]*NumbaEnv[^"\s]*)"? =', re.MULTILINE)

# The number of a function in a name made by Numba, as an ABI tag (Itanium C++ ABI, sec. 5.1.4): B4v143.
_NUMBER = re.compile(r"B\d+v\d+")


class PartLibrary(CodeLibrary):
    """A code library with the functions of one part alone: neither linked, optimised as a whole, nor machine code.

    The cover compiled for 11.7 s of processor time when every part was made machine code too, and did for 8.8 s
    without.  What a part calls is linked when the entry is (studio: 1.6 s were spent on linking parts with parts).

    Attributes
    ----------
    bitcode : its LLVM code.
    callees : libraries that it calls directly, in order.
    is_foreign : it is of a function of Numba's own, such as `min`.
    is_bound : it is of use to this process alone, since it names an object or an address of it.
    is_kept : it is on disk.
    """

    def __init__(self, name: str, *, is_foreign: bool = False) -> None:
        super().__init__(cpu_target.target_context.codegen(), name)
        self.callees: dict[PartLibrary, None] = {}
        self.is_foreign, self.is_bound, self.is_kept = is_foreign, False, False
        self.bitcode = b""
        self._renamed: dict[str, str] = {}
        self._finalized = True

    @functools.cached_property
    def module(self) -> Any:
        """Its LLVM code.

        Read from bitcode in the process that lowered it as in any other: LLVM keeps more than is in bitcode, such as
        the order in which values are used, and a kernel is not to depend on what was on disk.
        """
        return llvm.parse_bitcode(self.bitcode)

    def create_ir_module(self, name: str) -> Any:
        return self._codegen._create_empty_module(name)

    def add_linking_library(self, library: Any) -> None:
        if not isinstance(library, PartLibrary):
            library, renamed = _foreign(library)
            self._renamed.update(renamed)
        self.callees[library] = None

    def add_ir_module(self, ir_module: Any) -> None:
        text = normalize_ir_text(str(ir_module))
        for old, new in self._renamed.items():
            text = text.replace(f'@"{old}"', f'@"{new}"')
        self.is_bound = _is_bound(text)
        module = llvm.parse_assembly(text)
        module.name = ir_module.name
        module.verify()
        CPUCodeLibrary._optimize_functions(self, module)  # type: ignore[arg-type]
        _set_linkage(module, llvm.Linkage.external, _LINKED_ONCE)
        self.bitcode = module.as_bitcode()

    def finalize(self) -> None:
        """Return at once: there is nothing to be done."""

    def get_function(self, name: str) -> Any:
        return self.module.get_function(name)

    def get_llvm_str(self) -> str:
        return str(self.module)

    def get_asm_str(self) -> str:
        return str(self._codegen._tm.emit_assembly(self.module))

    def _get_module_for_linking(self) -> Any:
        """Link it with all that it calls, directly or not."""
        linked = self.module.clone()
        # Only what is called is linked in, and the linker has yet to see who calls this.
        own = _set_linkage(linked, llvm.Linkage.linkonce_odr, "external")
        for library in _callees(self):
            linked.link_in(library.module, preserve=True)
        for name in own:
            linked.get_function(name).linkage = _LINKED_ONCE
        return linked


_foreign_libraries: dict[Any, tuple[PartLibrary, dict[str, str]]] = {}


def _foreign(library: Any) -> tuple[PartLibrary, dict[str, str]]:
    """Make a part of a library that Numba has compiled by itself, such as that of `min`.

    Numba numbers functions in the order in which a process compiles them, so that of two processes one may have another
    function of the same name.  Here a name says what is in it.

    Returns
    -------
    The part, and the names of functions in it by those that Numba gave them.
    """
    if library not in _foreign_libraries:
        module = library._get_module_for_linking().clone()
        names = [function.name for function in module.functions if function.linkage == llvm.Linkage.linkonce_odr]
        text = str(module)
        content = hashlib.sha256(_NUMBER.sub("", text).encode()).hexdigest()[:24]
        renamed = {name: f"foreign.{number}.{content}" for number, name in enumerate(names)}
        for old, new in renamed.items():
            module.get_function(old).name = new
        part = PartLibrary(f"foreign.{content}", is_foreign=True)
        part.bitcode = module.as_bitcode()
        # Older versions of Numba have no such functions, which a library needs called when it is loaded.
        part.is_bound = _is_bound(text) or bool(getattr(library, "_reload_init", ()))
        _foreign_libraries[library] = part, renamed
    return _foreign_libraries[library]


def _is_bound(text: str) -> bool:
    """Return True if LLVM code holds an address of this process, or uses Numba's environment of Python objects."""
    return "numba.dynamic.globals" in text or any(text.count(name) > 1 for name in _ENVIRONMENT.findall(text))


def _set_linkage(module: Any, old: Any, new: str) -> list[str]:
    """Change the linkage of the functions that a module defines, and list their names."""
    changed = [function for function in module.functions if not function.is_declaration and function.linkage == old]
    for function in changed:
        function.linkage = new
    return [function.name for function in changed]


def _callees(library: PartLibrary) -> list[PartLibrary]:
    """List all libraries that one calls, directly or not, each after all that call it."""
    seen: set[PartLibrary] = set()
    last_first: list[PartLibrary] = []

    def visit(caller: PartLibrary) -> None:
        seen.add(caller)
        for callee in caller.callees:
            if callee not in seen:
                visit(callee)
        last_first.append(caller)

    visit(library)
    return last_first[-2::-1]
