"""Show the examples of docstrings as code: an extension of griffe, which reads the docstrings."""

from __future__ import annotations

from typing import Any

import griffe


def fenced(text: str) -> str:
    """Return a docstring with each run of doctest lines in a fenced code block."""
    out: list[str] = []
    inside = False
    for line in text.splitlines():
        starts, ends = line.startswith(">>>"), not line.strip()
        if inside and ends:
            out.append("```")
            inside = False
        if starts and not inside:
            out.append("```pycon")
            inside = True
        out.append(line)
    return "\n".join([*out, "```"] if inside else out)


class FencedDoctests(griffe.Extension):
    """A griffe extension that fences the doctest examples of every docstring in a package."""

    def on_instance(self, *, obj: griffe.Object, **_kwargs: Any) -> None:
        """Fence the examples in the docstring of one object, if it has any."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)
