"""The fenced code blocks of the documents."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted(
    {
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/**/*.md"),
        *ROOT.glob("examples/**/*.md"),
        *ROOT.glob("tests/exchange/**/*.md"),
    }
)
FENCE = re.compile(r"^```(.*)\n((?:.*\n)*?)```$", re.MULTILINE)


@dataclass(frozen=True)
class CodeBlock:
    """A code block as it is printed.

    Attributes:
        document: path of the document in the repository.
        line: number of the line of the opening fence, from 1.
        language: the word behind the opening fence.
        text: the lines between the fences.
    """

    document: str
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.document}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """The lines of a shell block without comments."""
        return [re.sub(r"\s+#.*", "", line) for line in self.text.splitlines() if line.strip()]


def code_blocks(*languages: str) -> list[CodeBlock]:
    """Return all blocks in one of ``languages``, or in any without arguments."""
    return [
        CodeBlock(
            document.relative_to(ROOT).as_posix(),
            text[: fence.start()].count("\n") + 1,
            fence[1].strip(),
            fence[2],
        )
        for document in DOCUMENTS
        for text in [document.read_text(encoding="utf-8")]
        for fence in FENCE.finditer(text)
        if not languages or fence[1].strip() in languages
    ]


def code_block(document: str, start: str) -> CodeBlock:
    """Return the block of a document whose text begins with ``start``."""
    (block,) = (
        candidate
        for candidate in code_blocks()
        if candidate.document == document and candidate.text.startswith(start)
    )
    return block
