"""Sizes of windows [px], phones, and tests that are run at several sizes in both themes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

WIDE, WIDER, PORTRAIT, LANDSCAPE = (1440, 900), (1920, 1080), (390, 844), (844, 390)

SIZES = {"wide": WIDE, "wider": WIDER, "portrait": PORTRAIT, "landscape": LANDSCAPE}

PHONE: dict[str, Any] = {"has_touch": True, "is_mobile": True}
"""Playwright's options of a phone."""

SCHEMES = ("light", "dark")


def in_sizes_and_schemes(sizes: Iterable[str]) -> pytest.MarkDecorator:
    """Run a test with each `size` of ``sizes`` in each `scheme`, which takes long."""
    pairs = [
        pytest.param(size, scheme, marks=pytest.mark.long) for size in sizes for scheme in SCHEMES
    ]
    return pytest.mark.parametrize(("size", "scheme"), pairs)
