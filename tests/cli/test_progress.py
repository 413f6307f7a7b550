"""Progress is shown only on a terminal, and Ctrl-C ends a command at any time."""

from __future__ import annotations

import importlib
import io

import pytest

import katana450.cli.main
from katana450.extensions.progress import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "shown"), [(Terminal(), "\rWork  25%\rWork 100%\n"), (io.StringIO(), "")]
)
def test_items_pass_and_a_terminal_alone_shows_their_fraction(
    stream: io.StringIO, shown: str
) -> None:
    assert list(progress(range(4), 4, "Work", stream)) == [0, 1, 2, 3]
    assert stream.getvalue() == shown


def test_the_line_ends_when_the_work_breaks_off() -> None:
    terminal = Terminal()
    working = progress(range(4), 4, "Work", terminal)
    next(working)
    with pytest.raises(KeyboardInterrupt):
        working.throw(KeyboardInterrupt())  # type: ignore[attr-defined]
    assert terminal.getvalue().endswith("\n")


class Interrupting:
    """Is interrupted as it gets its name, while Python creates the class that holds it."""

    def __set_name__(self, owner: type, name: str) -> None:
        raise KeyboardInterrupt


def test_an_interrupt_while_a_class_is_created_ends_a_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        katana450.cli.main, "main", lambda: type("Holder", (), {"held": Interrupting()})
    )
    # The package has the name of its module as an attribute as soon as that is imported.
    monkeypatch.setattr(katana450.cli, "main", katana450.cli.main)
    assert importlib.reload(katana450.cli).main() == 130
