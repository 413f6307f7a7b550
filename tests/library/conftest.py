"""The arm of the library, in each frame of poses."""

from __future__ import annotations

import pytest

import katana450


@pytest.fixture(scope="session")
def shoulder_arm() -> katana450.Arm:
    """Return the Katana450 with poses in the frame {S}."""
    return katana450.load()


@pytest.fixture(scope="session")
def base_arm() -> katana450.Arm:
    """Return the Katana450 with poses in the base frame."""
    return katana450.load(frame="base")
