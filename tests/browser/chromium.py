"""Find a Chromium, install one where there is none, and launch it with WebGL and no GPU.

``python tests/browser/chromium.py`` finds or installs; it exits with 1 when neither works.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Error, Playwright, sync_playwright

ENVIRONMENT_VARIABLE = "KATANA450_BROWSER"
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
APPLICATIONS = (
    Path("/Applications/Google Chrome.app/Contents/MacOS/Google Chrome"),
    Path("/Applications/Chromium.app/Contents/MacOS/Chromium"),
)

# Chromium takes only the last list of these. The first names are those of Playwright's list. The
# last two load the pages of the address bar in each new window, for 0.6 s of processor time.
DISABLED_FEATURES = (
    "AvoidUnnecessaryBeforeUnloadCheckSync",
    "DestroyProfileOnBrowserClose",
    "HttpsUpgrades",
    "HttpsFirstBalancedModeAutoEnable",
    "LensOverlay",
    "MediaRouter",
    "PaintHolding",
    "ThirdPartyStoragePartitioning",
    "AvoidCorsURLLoaderRestartOnRedirect",
    "TcpPortRandomizationWin",
    "OptimizationHints",
    "NetworkTimeServiceQuerying",
    "AimEnabled",
    "PreconnectToSearch",
    "msForceBrowserSignIn",
    "msEdgeUpdateLaunchServicesPreferredVersion",
    "WebUIOmniboxPopup",
    "WebUIOmniboxAimPopup",
)
FLAGS = (
    f"--disable-features={','.join(DISABLED_FEATURES)}",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--disable-gpu-compositing",
    "--force-device-scale-factor=1",
    # A page behind another must still draw and keep its timers.
    "--disable-background-timer-throttling",
    "--disable-renderer-backgrounding",
    "--disable-backgrounding-occluded-windows",
    # A camera that shows a test picture, for pages that may use one.
    "--use-fake-device-for-media-stream",
)
# Software renderers, the fastest first. Mesa's llvmpipe draws about twice as fast as SwiftShader,
# but exists only on Linux with Mesa.
RENDERERS = {
    "llvmpipe": ("--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist"),
    "SwiftShader": ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
}
HAS_WEBGL = "() => document.createElement('canvas').getContext('webgl2') !== null"


class BrowserError(RuntimeError):
    """Raised without a usable browser; the message names what to install or to set."""


INSTALLATION = (
    ("apt-get", "update"),
    (
        *("apt-get", "install", "--yes", "--no-install-recommends"),
        *("chromium", "libgl1-mesa-dri", "libegl1"),
    ),
)
"""Commands that install a browser on Debian and Ubuntu."""

REMEDY = (
    "Install Chromium or Chrome, for example: "
    f"{' && '.join('sudo ' + ' '.join(command) for command in INSTALLATION)}\n"
    f"Or set {ENVIRONMENT_VARIABLE} to the path of one."
)


def find() -> Path | None:
    """Return the path of the browser in the environment, otherwise of the first installed one.

    Raises BrowserError if the environment names a missing file.
    """
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    if named:
        path = shutil.which(named)
        if path is None:
            raise BrowserError(
                f"{ENVIRONMENT_VARIABLE}={named} is not a program that can be run: "
                "set it to the path of a Chromium or Chrome, or unset it"
            )
        return Path(path)
    on_path = (Path(path) for name in NAMES if (path := shutil.which(name)))
    return next(on_path, next((path for path in APPLICATIONS if path.exists()), None))


def version(path: Path) -> str:
    """Return the version text of the browser. Raises BrowserError if it does not run."""
    try:
        answer = subprocess.run(
            [str(path), "--version"], capture_output=True, text=True, timeout=60, check=True
        )
    except (OSError, subprocess.SubprocessError) as error:
        reason = (getattr(error, "stderr", None) or str(error)).strip()
        raise BrowserError(
            f"{path} does not run ({reason}): reinstall it, or set {ENVIRONMENT_VARIABLE} "
            "to the path of another Chromium or Chrome"
        ) from error
    return answer.stdout.strip()


def ensure() -> Path:
    """Return the path of a browser that runs; install one if there is none.

    Raises BrowserError with a remedy if the installation is not possible.
    """
    path = find()
    if path is None:
        _install()
        path = find()
    if path is None:
        raise BrowserError(f"the installation provided none of {', '.join(NAMES)}. {REMEDY}")
    version(path)
    return path


def _install() -> None:
    if not shutil.which("apt-get"):
        raise BrowserError(f"no Chromium was found. {REMEDY}")
    prefix: tuple[str, ...] = ()
    if os.geteuid() != 0:
        prefix = ("sudo", "--non-interactive")
        if not shutil.which("sudo") or subprocess.run([*prefix, "true"], check=False).returncode:
            raise BrowserError(f"no Chromium was found, and root must install one. {REMEDY}")
    for command in INSTALLATION:
        print("Running:", *prefix, *command, flush=True)
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        status = subprocess.run([*prefix, *command], env=environment, check=False).returncode
        if status:
            raise BrowserError(f"`{' '.join(command)}` failed with status {status}. {REMEDY}")


@contextmanager
def launched() -> Iterator[Browser]:
    """Launch a headless browser that draws WebGL 2 in software, and close it at the end.

    Raises BrowserError if there is no browser, or if none of RENDERERS works.
    """
    path = ensure()
    with sync_playwright() as playwright:
        browser = _launch(playwright, path)
        try:
            yield browser
        finally:
            browser.close()


def _launch(playwright: Playwright, path: Path) -> Browser:
    failures = []
    for renderer, flags in RENDERERS.items():
        if renderer == "llvmpipe" and sys.platform != "linux":
            continue
        try:
            browser = playwright.chromium.launch(
                executable_path=path,
                args=[*FLAGS, *flags],
                # Use the same renderer with and without a graphics card.
                env={**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1"},
            )
        except Error as error:
            failures.append(f"{renderer}: {error}")
            continue
        page = browser.new_page()
        if page.evaluate(HAS_WEBGL):
            page.close()
            return browser
        failures.append(f"{renderer}: no WebGL 2")
        browser.close()
    raise BrowserError(f"{path} cannot draw WebGL 2 ({'; '.join(failures)}). {REMEDY}")


def main() -> None:
    """Print the browser that tests use; install one if there is none."""
    try:
        path = ensure()
        print(f"Browser for the tests: {path} ({version(path)})")
    except BrowserError as error:
        raise SystemExit(f"katana450 tests need a browser: {error}") from error


if __name__ == "__main__":
    main()
