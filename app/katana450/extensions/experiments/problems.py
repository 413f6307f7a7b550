"""The problems of a script in the terminal."""

from __future__ import annotations

import sys
from pathlib import Path

from katana450.extensions.programs.language.source import ScriptError


def print_problems(error: ScriptError, source: str) -> None:
    """Print each problem with its file, line and column; ``source`` names the script."""
    for problem in error.problems:
        file = str(Path(source).parent / problem.file) if problem.file else source
        print(f"{file}:{problem.line}:{problem.column}: {problem.text}", file=sys.stderr)
