"""Conversion of exceptions in libraries that parse untrusted files to messages about the file."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from katana450.errors import InputError


@contextmanager
def failures_in_words(name: str) -> Iterator[None]:
    """Raise InputError about the file ``name`` for any exception of a library in the block."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            # Older numpy only warns about text that is not a number.
            warnings.filterwarnings("error", message="string or file could not be read")
            yield
    except (InputError, MemoryError, RecursionError):
        raise
    except (IndexError, KeyError, StopIteration) as error:
        raise InputError(f"{name} is corrupt: it refers to a part that is missing.") from error
    except Exception as error:
        reason = " ".join(str(error).split())[:120].rstrip(".")
        raise InputError(f"{name} is corrupt: {reason or type(error).__name__}.") from error
