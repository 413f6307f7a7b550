"""Wrong values of options are refused in words, and not with the names of functions."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import pytest

from katana450.cli.main import _parser


def options_of(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.Action]]:
    """Yield the name of each command with its options and arguments that are read."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from options_of(inner)
        elif action.type not in (None, int, float):
            yield parser.prog, action


@pytest.mark.parametrize("text", ["", "abc", "nan", "-1", "1,2", "1e999", "9" * 400])
def test_no_value_is_refused_with_the_name_of_a_function(text: str) -> None:
    read = 0
    for command, action in options_of(_parser()):
        assert callable(action.type)
        try:
            action.type(text)
            read += 1
        except argparse.ArgumentTypeError:
            continue
        except ValueError as error:
            pytest.fail(f"{command} {action.dest}: {error}")
    # Paths and names take any text.
    assert read > 10


def test_a_command_collects_its_own_options_alone() -> None:
    assert {name for name, _ in options_of(_parser(["fk", "--urdf", "a.urdf"]))} == {"katana450 fk"}
    for other in ([], ["--help"], ["flyy"]):
        assert len({name for name, _ in options_of(_parser(other))}) > 3
