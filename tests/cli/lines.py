"""The commands ``fk`` and ``ik`` in this process: lines in, lines out."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from collections.abc import Sequence
from typing import Any

import pytest

from katana450.cli.main import main


def ask(
    command: str, lines: Sequence[object], *options: str, status: int = 0
) -> list[dict[str, Any]]:
    """Return the answers to ``lines``: strings are sent unchanged, other values as JSON."""
    text = "".join((x if isinstance(x, str) else json.dumps(x)) + "\n" for x in lines)
    out, err = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "stdin", io.StringIO(text))
        assert main([command, *options]) == status
    assert err.getvalue() == ""
    return [json.loads(line) for line in out.getvalue().splitlines()]
