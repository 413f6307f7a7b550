"""The document of viser in a page."""

from __future__ import annotations

from playwright.sync_api import Frame, Page


def viser_frame(page: Page) -> Frame:
    """Return the document of viser: the page itself, or a frame in it."""
    element = page.query_selector("iframe#scene")
    if element is None:
        return page.main_frame
    frame = element.content_frame()
    assert frame is not None
    frame.wait_for_url("**/viser/**", wait_until="commit")
    return frame
