"""``katana450 serve`` as a person starts it: ready, refused, stopped."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.cli.main import main
from tests.browser.server import AppServer, ServerError, free_port
from tests.commands import completed
from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]


def serve(*options: str) -> subprocess.CompletedProcess[str]:
    return completed([sys.executable, "-m", "katana450", "serve", *options])


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer() as server:
        yield server


def test_it_serves_the_page_on_this_machine_only(server: AppServer) -> None:
    with urllib.request.urlopen(server.url, timeout=10) as page:
        assert page.status == 200
    listening = Path("/proc/net/tcp")
    if listening.exists():
        port = f"{server.port:04X}"
        addresses = {
            line.split()[1].split(":")[0]
            for line in listening.read_text(encoding="ascii").splitlines()[1:]
            if line.split()[1].endswith(":" + port) and line.split()[3] == "0A"
        }
        assert addresses == {"0100007F"}  # 127.0.0.1


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_starts_no_process_that_only_cleans_up_and_no_threads_of_blas(server: AppServer) -> None:
    children = Path(f"/proc/{server.pid}/task/{server.pid}/children").read_text(encoding="ascii")
    names = {int(child): _of(int(child), "comm").strip() for child in children.split()}
    assert sorted(names.values()) == ["katana450 arm", "katana450 front", "katana450 stop"]
    for child in names:
        assert "OPENBLAS_NUM_THREADS=1" in _of(child, "environ").split("\0")


def _of(process: int, file: str) -> str:
    return Path(f"/proc/{process}/{file}").read_text(encoding="utf-8")


def test_busy_port_is_reported_with_the_remedy() -> None:
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", free_port()))
        other.listen()
        port = other.getsockname()[1]
        done = serve("--port", str(port))
    assert done.returncode == 1
    in_use = f"katana450: Port {port} on 127.0.0.1 is in use. Choose another one: --port {port + 2}"
    assert done.stderr == f"{in_use}\n"


def test_two_servers_do_not_share_a_port(server: AppServer) -> None:
    runs = f"already runs on port {server.port}. Open its page, or add --port {server.port + 2}"
    with pytest.raises(ServerError, match=runs):
        AppServer(port=server.port).start()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param(("--port", "70000"), "0 to 65535", marks=pytest.mark.long),
        pytest.param(("--host", "no.such.host.invalid"), "--host", marks=pytest.mark.long),
        (("--host", "192.0.2.1", "--port", "8299"), "--host"),
    ],
)
def test_invalid_address_is_reported(options: tuple[str, ...], message: str) -> None:
    done = serve(*options)
    assert done.returncode != 0
    assert message in done.stderr
    assert "Traceback" not in done.stderr


# By SIGINT every server of the tests ends.
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGINT, marks=pytest.mark.long), signal.SIGTERM]
)
def test_viewer_stops_on_request(server: AppServer, number: signal.Signals) -> None:
    if not server.running:
        server.start()
    printed = server.output
    os.kill(server.pid, number)
    until(lambda: not server.running, 5.0)
    assert server.status == 0, server.output
    server.stop()
    # Neither the program nor a library prints anything after the interrupt.
    assert server.output == printed


def test_the_command_prints_its_version_and_its_commands(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for option, start in (("--version", "katana450 "), ("--help", "usage: katana450")):
        with pytest.raises(SystemExit):
            main([option])
        assert capsys.readouterr().out.startswith(start)


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have other limits")
def test_too_low_limit_of_the_system_is_reported() -> None:
    command = [sys.executable, "-m", "katana450", "serve", "--port", str(free_port())]
    done = completed(["sh", "-c", 'ulimit -n 20; exec "$0" "$@"', *command])
    assert done.returncode == 1
    assert "Only 20 files can be open at once" in done.stderr
    assert "ulimit" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_full_disk_for_the_output_does_not_stop_the_server() -> None:
    port = free_port()
    command = [sys.executable, "-m", "katana450", "serve", "--port", str(port)]
    with Path("/dev/full").open("w") as full:
        process = subprocess.Popen(
            command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT
        )
    try:
        due = time.monotonic() + 60.0
        while True:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=10) as page:
                    assert page.status == 200
                break
            except OSError:
                assert process.poll() is None
                assert time.monotonic() < due
                time.sleep(0.1)
    finally:
        process.send_signal(signal.SIGINT)
        errors = process.communicate(timeout=20)[1]
    assert process.returncode == 0
    assert "The output cannot be written: No space left on device." in errors
    assert "Traceback" not in errors


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_full_disk_for_the_output_of_a_command_is_reported() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "katana450", "fk"],
            input='{"q": [0, 0, 0, 0, 0]}\n',
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            timeout=60,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "katana450: The output cannot be written: No space left on device.\n"
