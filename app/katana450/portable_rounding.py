"""Environment of processes in which numbers are rounded alike on every x86-64 processor.

OpenBLAS, numpy and glibc's libm choose other code for other processors, with sums in another order
and with or without fused multiply-add. The last bits of a result then depend on the machine. With
these variables they use the code that every x86-64 processor runs, in one thread. They are read
when a process begins, so they are for processes that are yet to be started.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

PROCESSORS = ("x86_64", "AMD64")

BLAS = "OPENBLAS_CORETYPE"
BLAS_CORE = "Nehalem"
"""The oldest processor for which numpy is built."""

THREADS = "OPENBLAS_NUM_THREADS"
"""More threads divide sums by the number of cores. They also wait busily when numpy is loaded, and
the arrays of an arm are too small for them."""

LIBM = "GLIBC_TUNABLES"
LIBM_CHOICE = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"

NUMPY = "NPY_DISABLE_CPU_FEATURES"
NUMPY_CHOICE = "X86_V3 X86_V4 AVX512_ICL AVX512_SPR AVX2 FMA3 AVX512F AVX512_SKX"
"""All extensions with code of their own for sine and others in numpy 2.1 and later. Those that a
version or a processor lacks are left out by numpy."""


def can_round_portably() -> bool:
    """Return whether this processor is one of those that can round alike."""
    return platform.machine() in PROCESSORS


def portable_rounding(environment: Mapping[str, str]) -> dict[str, str]:
    """Return ``environment`` with the variables that make rounding independent of the processor.

    On processors other than x86-64 it is returned unchanged.
    """
    variables = dict(environment)
    if can_round_portably():
        tunables = variables.get(LIBM, "")
        if not tunables.endswith(LIBM_CHOICE):
            # The last one counts.
            variables[LIBM] = f"{tunables}:{LIBM_CHOICE}".lstrip(":")
        variables |= {BLAS: BLAS_CORE, THREADS: "1", NUMPY: NUMPY_CHOICE}
    return variables


def rounds_portably(environment: Mapping[str, str]) -> bool:
    """Return whether a process that begins with ``environment`` rounds alike on all processors."""
    return BLAS in environment and portable_rounding(environment) == dict(environment)


ROUNDS_PORTABLY: Final = rounds_portably(os.environ)
"""Whether this process rounds alike on all processors. A later change of its environment does not
matter."""


@contextmanager
def starting_portable_processes() -> Iterator[None]:
    """Let processes that are started in the block round alike on all processors."""
    before = {name: os.environ.get(name) for name in (BLAS, THREADS, LIBM, NUMPY)}
    os.environ.update(portable_rounding(os.environ))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
