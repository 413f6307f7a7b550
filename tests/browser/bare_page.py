"""The document of our page, without server, viser and scripts: single scripts are tested in it.

It costs a fraction of a second, where a window on a server costs seconds.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Browser, Page, Route

from katana450.resources import STATIC

ORIGIN = "http://page.test"

SCRIPT = re.compile(r"<script [^>]*></script>")
FRAME = re.compile("<iframe.*?</iframe>")


@contextmanager
def bare_page(
    browser: Browser, *, arm: dict[str, Any] | None = None, **options: Any
) -> Iterator[Page]:
    """Open the document. ``arm``: the answer ``arm`` of the API for scripts that ask for it.

    ``options``: of the browser's context, for instance its locale.
    """
    context = browser.new_context(viewport={"width": 1280, "height": 800}, **options)
    html = (STATIC / "index.html").read_text(encoding="utf-8")
    document = FRAME.sub("", SCRIPT.sub("", html))

    def answer(route: Route) -> None:
        path = route.request.url.removeprefix(f"{ORIGIN}/").partition("?")[0]
        if path == "":
            route.fulfill(body=document, content_type="text/html")
        elif path == "api/v1/arm":
            route.fulfill(body=json.dumps(arm), content_type="application/json")
        else:
            route.fulfill(path=STATIC / path.removeprefix("static/"))

    context.route(f"{ORIGIN}/**", answer)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        page.goto(f"{ORIGIN}/")
        yield page
        assert errors == []
    finally:
        context.close()


def load(page: Page, name: str, path: str) -> None:
    """Load a module of static/; the document calls its exports by ``name``."""
    page.evaluate(
        "async ([name, path]) => { window[name] = await import(path) }",
        [name, f"{ORIGIN}/static/{path}"],
    )


def module(page: Page, path: str, function: str, *values: Any) -> Any:
    """Return ``function(exports, ...values)`` for the exports of a module of static/."""
    return page.evaluate(
        f"async ([path, values]) => ({function})(await import(path), ...values)",
        [f"{ORIGIN}/static/{path}", list(values)],
    )
