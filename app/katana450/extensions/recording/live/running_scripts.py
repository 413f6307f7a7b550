"""The scripts that run, for the process that records: their texts are attached to recordings."""

from __future__ import annotations

import math
import threading

import msgspec

MAX_RUNS = 100
"""Number of runs that wait to be recorded, each with a script of up to 64 KB."""


class ScriptNote(msgspec.Struct, frozen=True, tag="script"):
    """A run of a script has begun, or ended.

    Attributes:
        name: name of the script.
        text: its text, with those of all files that it names.
        began: time at which it began [s], which identifies the run.
        ended: time at which it ended [s]; None while it runs.
    """

    name: str
    text: str
    began: float
    ended: float | None = None


class RunningScripts:
    """The runs that have not ended, or have ended since they were last recorded. For any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._runs: dict[float, ScriptNote] = {}

    def note(self, run: ScriptNote) -> None:
        """Take note of ``run``. The oldest is forgotten if there are too many."""
        with self._lock:
            self._runs[run.began] = run
            while len(self._runs) > MAX_RUNS:
                del self._runs[min(self._runs)]

    def end_all(self, t: float) -> None:
        """Note that all runs have ended at ``t`` [s], with the process that ran them."""
        with self._lock:
            for began, run in self._runs.items():
                if run.ended is None:
                    self._runs[began] = msgspec.structs.replace(run, ended=t)

    def read(self, until: float = math.inf) -> list[ScriptNote]:
        """Return the runs that began ``until`` [s], by their begin; an ended one is returned once.

        Notes may come before the ticks of their time: those of later runs wait.
        """
        with self._lock:
            runs = [self._runs[began] for began in sorted(self._runs) if began <= until]
            for run in runs:
                if run.ended is not None:
                    del self._runs[run.began]
            return runs
