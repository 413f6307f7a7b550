"""What every kind of step can do."""

from __future__ import annotations

from typing import Protocol, Self

from katana450.extensions.programs.bench import Bench
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value


class Step(Protocol):
    """One of them."""

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        """From what stands behind its name. Raises ScriptError."""
        ...

    def lay(self, bench: Bench) -> None:
        """Note what is to be done, with its plans. Raises InputError where that cannot be."""
        ...


def nothing(value: Value, name: str) -> None:
    """Refuse anything that stands behind a step that says all by its ``name``."""
    if value.kind != "nothing":
        raise value.wrong(f"`{name}` says all there is to say; nothing stands behind it.")
