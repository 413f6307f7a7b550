"""Messages on standard output of a server, which must run even where nothing can be written."""

from __future__ import annotations

import os
import sys
from contextlib import suppress


def say(text: str) -> None:
    """Print ``text`` at once. If that fails, report it on standard error and print nothing more."""
    try:
        print(text, flush=True)
    except OSError as error:
        drop_output(error)


def drop_output(error: OSError) -> None:
    """Report that standard output cannot be written, and discard it from now on."""
    # The rest of the buffer is written at the end of the process, which would fail again.
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
    print(f"katana450: The output cannot be written: {error.strerror}.", file=sys.stderr)
