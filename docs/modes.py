"""Write the diagram of the modes in ``docs/tour.md`` from the table of transitions.

Run it with ``python -m docs.modes``.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from katana450.arm.control.session.transitions import TABLE, Effect
from katana450.arm.control.state.modes import MODES, Mode

FILE = Path(__file__).resolve().parent / "tour.md"
BEGIN, END = "<!-- modes: written by python -m docs.modes -->\n", "<!-- end of modes -->\n"


def diagram() -> str:
    """Return the modes, and the acts that begin them, in the language of Mermaid.

    An arrow from "any mode" stands for all modes; the mode that the act continues is one of them.
    """
    acts: dict[tuple[str, str], list[str]] = defaultdict(list)
    for kind, row in TABLE.items():
        if row.begins is None:
            continue
        effects = {mode: row.effects[mode] for mode in MODES}
        starts = [mode for mode, effect in effects.items() if effect is Effect.SUPERSEDES]
        everywhere = {Effect.SUPERSEDES, Effect.CONTINUES} >= set(effects.values())
        for name in ["any mode"] if everywhere else map(_name, starts):
            acts[name, _name(row.begins)].append(kind.__name__)
    lines = [
        f'    {start.replace(" ", "_")}["{start}"] -- "{", ".join(names)}" --> {end}["{end}"]'
        for (start, end), names in acts.items()
    ]
    return "\n".join(("```mermaid", "flowchart LR", *lines, "```", ""))


def content(text: str) -> str:
    """Return ``text`` with the present diagram between its two marks."""
    before, _, rest = text.partition(BEGIN)
    return before + BEGIN + "\n" + diagram() + "\n" + END + rest.partition(END)[2]


def _name(mode: type[Mode]) -> str:
    return mode.__name__.lower()


def main() -> None:
    """Write the file."""
    FILE.write_text(content(FILE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
