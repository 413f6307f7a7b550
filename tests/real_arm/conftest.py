"""Fixtures of the tests of the real arm."""

from __future__ import annotations

import pytest

from tests.real_arm.paper_arm import Conversation


@pytest.fixture
def talk() -> Conversation:
    return Conversation()
