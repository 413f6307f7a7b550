"""``katana450 run`` and ``katana450 demo``: simulate a script, or run it on a server."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import library_file, script_text


def print_problems(error: ScriptError, source: str) -> None:
    """Print each problem with its file, line and column; ``source`` names the script."""
    for problem in error.problems:
        file = str(Path(source).parent / problem.file) if problem.file else source
        print(f"{file}:{problem.line}:{problem.column}: {problem.text}", file=sys.stderr)


def run(options: Namespace) -> int:
    """Execute ``katana450 run``; return the exit status."""
    try:
        text = script_text(options.file)
        script = parse(text)
        if options.headless or options.dry_run or options.report is not None:
            from katana450.extensions.experiments.simulate import simulate

            status = simulate(script, options)
            if status or options.headless or options.dry_run:
                return status
        from katana450.extensions.experiments.live import run_live

        return run_live(text, script, options)
    except ScriptError as error:
        print_problems(error, str(options.file))
        return 1


def demo(options: Namespace) -> int:
    """Execute ``katana450 demo``; return the exit status."""
    options.file = library_file(options.demo)
    return run(options)
