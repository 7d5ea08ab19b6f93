"""LLVM intrinsics for kernels: pass a scene by its address, and prefetch memory."""

from typing import Any

from raytracer.core.compiler.declarations import declare_global


def intrinsic(function: Any) -> Any:
    """Give a function its implementation for kernels, of the same name in `lowered_intrinsics`."""

    def make_type() -> Any:
        from numba.core.registry import cpu_target

        from raytracer.core.compiler import lowered_intrinsics

        context = cpu_target.typing_context
        # Numba learns of new functions when it is asked to.
        context.refresh()
        return context.resolve_value_type(getattr(lowered_intrinsics, function.__name__))

    declare_global(function, make_type)
    return function


@intrinsic
def share(value):
    """Pass a NamedTuple by its address, which is valid while the function that calls this runs; for entries only."""
    return value


@intrinsic
def prefetch(address):
    """Prefetch the cache line at an address (intp) that will be read soon."""
