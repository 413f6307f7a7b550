"""Single faults in a copy of the tree, and whether the tests find them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("faults.toml")

TIMEOUT = 240.0
"""[s] Time after which tests that a fault has brought to a standstill count as failed."""

PASSED, FAILED, NO_TESTS = 0, 1, 5
"""Exit status of pytest."""

FAILING = re.compile(r"^(?:FAILED|ERROR) tests/(\S+)", re.MULTILINE)
"""Pattern of the first test that fails, in the summary of pytest."""


class Mutant(NamedTuple):
    """One fault.

    Attributes:
        fault: what is wrong, in words.
        file: path from the root of the repository.
        old, new: a text that occurs once in the file, and the faulty text.
        tests: files below tests/ that find it, separated by blanks.
    """

    fault: str
    file: str
    old: str
    new: str
    tests: str


def mutants() -> tuple[Mutant, ...]:
    """Return all faults of the table."""
    rows = tomllib.loads(TABLE.read_text(encoding="utf-8"))["mutant"]
    return tuple(Mutant(**row) for row in rows)


class Copy:
    """A copy of the tree in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # A server below prefers the package of the copy to ours, which is installed.
        path = os.pathsep.join((str(folder / "app"), str(folder)))
        self._environment = os.environ | {"PYTHONPATH": path}
        for name in _files():
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)

    def finder(self, mutant: Mutant) -> str | None:
        """Return the test that fails with the fault of ``mutant``; None if all pass.

        Raises RuntimeError if the tests do not run.
        """
        with self._changed(mutant):
            return self._failing(mutant.tests.split())

    @contextmanager
    def _changed(self, mutant: Mutant) -> Iterator[None]:
        path = self._folder / mutant.file
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(text, encoding="utf-8")

    def _failing(self, tests: list[str]) -> str | None:
        files = [f"tests/{path}" for path in tests]
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *files]
        try:
            done = subprocess.run(
                command,
                cwd=self._folder,
                env=self._environment,
                capture_output=True,
                text=True,
                timeout=TIMEOUT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return f"no end within {TIMEOUT:g} s"
        if done.returncode in (PASSED, NO_TESTS):
            return None
        failing = FAILING.search(done.stdout)
        if done.returncode != FAILED or failing is None:
            raise RuntimeError(f"The tests did not run.\n{done.stdout}{done.stderr}")
        return failing[1]


def _files() -> list[str]:
    """Return the paths of the files of the tree, without what git ignores."""
    command = ("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def score(chosen: list[Mutant]) -> int:
    """Print which test finds each of the ``chosen`` faults; return the number of faults caught."""
    caught = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for mutant in chosen:
            began = time.monotonic()
            finder = copy.finder(mutant)
            caught += finder is not None
            word, seconds = "MISSED" if finder is None else "found ", time.monotonic() - began
            print(f"{word} {seconds:5.1f} s  {mutant.file}: {mutant.fault}", flush=True)
            if finder is not None:
                print(f"                by {finder}", flush=True)
    print(f"{caught} of {len(chosen)} faults are caught.")
    return caught
