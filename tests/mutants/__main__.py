"""Print which single faults the tests find: ``python -m tests.mutants [WORD...]``.

A word selects the faults whose file or description contains it.
"""

from __future__ import annotations

import sys

from tests.mutants.mutant import mutants, score


def main(words: list[str]) -> int:
    """Run the tests of the selected faults; return 1 if they miss one."""
    chosen = [
        mutant
        for mutant in mutants()
        if not words or any(word in f"{mutant.file} {mutant.fault}" for word in words)
    ]
    return score(chosen) < len(chosen)


sys.exit(main(sys.argv[1:]))
