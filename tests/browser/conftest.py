"""One browser for all tests here, windows on servers, and pictures of failed tests."""

from __future__ import annotations

import re
import threading
from collections.abc import Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, Protocol

import pytest
from playwright.sync_api import Browser
from playwright.sync_api import Error as PlaywrightError

from katana450.client import Client, connect
from tests.browser.camera import Drawing
from tests.browser.chromium import launched
from tests.browser.page import FIRST_VISIT, ViserPage
from tests.browser.person import Person
from tests.browser.server import APP, RECORDING_APP, AppServer
from tests.browser.session import MOVE, Truth, clear_stop, prepare, take
from tests.browser.shared_server import SharedServer
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, SIZES, WIDE

THREAD_SECONDS = 5.0
ARTEFACTS = Path(__file__).resolve().parents[2] / "test-artefacts"


class Windows:
    """The windows that are open in one browser."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._pages: list[ViserPage] = []

    @contextmanager
    def open(self, url: str, **options: Any) -> Iterator[ViserPage]:
        """Open a window for the duration of the block; options are those of ViserPage.open."""
        page = ViserPage.open(self._browser, url, **options)
        self._pages.append(page)
        try:
            yield page
        finally:
            self._pages.remove(page)
            page.close()

    def save(self, stem: str) -> None:
        """Save a picture of each window and the errors on its console, as files `stem`-N."""
        ARTEFACTS.mkdir(exist_ok=True)
        for number, page in enumerate(self._pages, start=1):
            errors = "".join(f"{error}\n" for error in page.errors)
            (ARTEFACTS / f"{stem}-{number}.log").write_text(errors, encoding="utf-8")
            try:
                page.screenshot(ARTEFACTS / f"{stem}-{number}.png")
            except PlaywrightError as error:  # the page may have crashed
                print(f"window {number} gave no picture: {error}")


WINDOWS = pytest.StashKey[Windows]()


class OpenPage(Protocol):
    """Opens a window that closes with the test; options are those of ViserPage.open."""

    def __call__(self, url: str, **options: Any) -> ViserPage: ...


# Playwright keeps an asyncio loop running in this thread, so no other test can run one there.
# Therefore the browser ends with the tests of this folder, not with the session.
@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Launch a headless browser that draws WebGL in software."""
    before = set(threading.enumerate())
    with launched() as browser:
        yield browser
    # asyncio waits for the browser's process in a thread that ends shortly after it.
    for thread in set(threading.enumerate()) - before:
        thread.join(THREAD_SECONDS)
    left = set(threading.enumerate()) - before
    assert not left, f"the browser left threads behind: {left}"


@pytest.fixture(scope="package")
def windows(browser: Browser, request: pytest.FixtureRequest) -> Windows:
    """Return the windows of fixtures that outlive a test; each is saved when a test fails."""
    windows = Windows(browser)
    request.session.stash[WINDOWS] = windows
    return windows


@pytest.fixture
def open_page(windows: Windows) -> Iterator[OpenPage]:
    """Return a function that opens windows, which close with the test."""
    with ExitStack() as stack:

        def open_page(url: str, **options: Any) -> ViserPage:
            return stack.enter_context(windows.open(url, **options))

        yield open_page


@pytest.fixture(scope="package")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder in which the shared server keeps scripts of its users."""
    return tmp_path_factory.mktemp("scripts")


@pytest.fixture(scope="package")
def shared_server(browser: Browser, scripts: Path) -> Iterator[SharedServer]:  # noqa: ARG001
    """Return the server of the modules of this folder. It ends before the browser."""
    with SharedServer((*APP, "--programs", str(scripts))) as shared_server:
        yield shared_server


@pytest.fixture(scope="module")
def server(shared_server: SharedServer) -> AppServer:
    """Return the server in the state of a new one."""
    return shared_server.as_new()


@pytest.fixture(scope="package")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the server that records, with `ring` and `episodes` in it."""
    return tmp_path_factory.mktemp("recorded")


@pytest.fixture(scope="package")
def recording_server(browser: Browser, recorded: Path) -> Iterator[AppServer]:  # noqa: ARG001
    """Run a server that records, as the app does for people."""
    folders = ("--record", str(recorded / "ring"), "--episodes", str(recorded / "episodes"))
    with AppServer((*RECORDING_APP, "--silence", "2.0", *folders)) as server:
        yield server


class SharedWindow:
    """The window of the modules of this folder: open as long as its server runs."""

    def __init__(self, windows: Windows) -> None:
        self._windows = windows
        self._opened: ViserPage | None = None
        self._url = ""
        self._stack = ExitStack()

    def on(self, server: AppServer) -> ViserPage:
        """Return the window as a person opens it: no sheet, the first tab, the first view."""
        page = self._opened
        if page is not None and self._url == server.url and page.connected and not page.errors:
            page.reset()
            return page
        self.close()
        window = self._windows.open(server.url, nodes=("/arm", MOVE))
        self._opened, self._url = self._stack.enter_context(window), server.url
        return self._opened

    def close(self) -> None:
        self._stack.close()
        self._opened = None


@pytest.fixture(scope="package")
def shared_window(windows: Windows, shared_server: SharedServer) -> Iterator[SharedWindow]:  # noqa: ARG001
    """Return the window of the shared server, which ends after it."""
    with closing(SharedWindow(windows)) as window:
        yield window


@pytest.fixture
def truth(server: AppServer) -> Truth:
    return Truth(server)


@pytest.fixture(scope="module")
def window(server: AppServer, shared_window: SharedWindow) -> ViserPage:
    """Return a window with viser, which other modules use too."""
    return shared_window.on(server)


@pytest.fixture
def page(window: ViserPage, truth: Truth) -> Iterator[ViserPage]:
    """Return a window whose person drives, with the arm in the ready posture."""
    prepare(window, truth)
    yield window
    window.reset()
    assert window.errors == []


@pytest.fixture(scope="module")
def own_window(server: AppServer, windows: Windows) -> Iterator[ViserPage]:
    """Open our page without viser in its frame, which would take most of the time."""
    with windows.open(server.url, window=WIDE, drawing=Drawing.NONE) as page:
        yield page


@pytest.fixture
def own_page(own_window: ViserPage, truth: Truth) -> Iterator[ViserPage]:
    """Return our page alone, whose person drives, with the arm at rest."""
    take(own_window)
    if truth.status()["stopped"] is not None:
        clear_stop(own_window, truth)
    truth.wait(20.0, moving=False)
    yield own_window
    assert own_window.errors == []


@pytest.fixture
def new_page(server: AppServer, open_page: OpenPage, truth: Truth) -> Iterator[ViserPage]:
    """Return a new window whose person drives, for a single test."""
    page = open_page(server.url, nodes=("/arm", MOVE))
    prepare(page, truth)
    yield page
    assert page.errors == []


@pytest.fixture
def reader(server: AppServer) -> Iterator[Client]:
    """Connect a program that only reads."""
    with connect(server.url, "Reader") as reader:
        yield reader


@pytest.fixture(scope="session")
def artefacts() -> Path:
    """Return the folder for pictures and logs, outside version control."""
    ARTEFACTS.mkdir(exist_ok=True)
    return ARTEFACTS


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Save pictures of the windows when a test fails."""
    report = yield
    if report.failed and (windows := item.session.stash.get(WINDOWS, None)):
        windows.save(re.sub(r"[^\w.-]+", "-", f"{item.path.stem}-{item.name}").strip("-"))
    return report


@pytest.fixture
def person(
    server: AppServer, open_page: OpenPage, size: str, scheme: str, truth: Truth, artefacts: Path
) -> Iterator[Person]:
    """Return a person on a first visit, at the ``size`` and in the ``scheme`` of the test."""
    touches = SIZES[size] in (PORTRAIT, LANDSCAPE)
    page = open_page(
        server.url,
        nodes=("/arm", MOVE),
        window=SIZES[size],
        color_scheme=scheme,
        own_camera=True,
        script=FIRST_VISIT,
        **(PHONE if touches else {}),
    )
    if truth.status()["stopped"] is not None:
        clear_stop(page, truth)

    def keep(name: str) -> None:
        page.keep(artefacts / f"flow-{name}-{size}-{scheme}.png")

    yield Person(page, truth, keep, touches=touches)
    assert page.errors == []
