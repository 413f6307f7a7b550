"""Check of the limit on memory with which the server was started."""

from __future__ import annotations

import logging

from katana450.errors import ConfigurationError
from katana450.platform_support import memory_limit

log = logging.getLogger(__name__)

MIN_MEMORY, WANTED_MEMORY = 1 << 30, 4 << 30
"""Address space of a process [bytes]: without browsers and files the server takes 0.9 GiB, and the
reading of a file may take 1 GiB."""


def check_memory_limit() -> None:
    """Log a warning below ``WANTED_MEMORY``. Raises ConfigurationError below ``MIN_MEMORY``."""
    limit = memory_limit()
    if limit is None or limit >= WANTED_MEMORY:
        return
    what = f"Only {limit >> 20} MiB of memory can be used"
    remedy = f"Raise the limit to {WANTED_MEMORY >> 20} MiB (`ulimit -v {WANTED_MEMORY >> 10}`)."
    if limit < MIN_MEMORY:
        raise ConfigurationError(f"{what}, too little to run. {remedy}")
    log.warning("%s. Many clients or large files can use it up. %s", what, remedy)
