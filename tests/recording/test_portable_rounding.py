"""Verify that what a server records can be simulated to the bit on other processors.

Other processors are imitated by the variables that make BLAS, libm and numpy choose code for them.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from katana450.extensions.recording.files import simulation
from katana450.extensions.recording.files.header import PORTABLE, ROUNDING
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.messages import COMMANDS
from katana450.portable_rounding import portable_rounding, rounds_portably
from tests.commands import completed
from tests.conftest import LONG

TICKS = 3000 if LONG else 300

ROOT = Path(__file__).resolve().parents[2]
LOCK = ROOT / "requirements.lock"
"""The libraries that the app needs, with their versions."""

POURING_TICKS = 3700

RECORD = """
import sys
from pathlib import Path
from tests.recording.recorded import record
record(Path(sys.argv[1]), int(sys.argv[2]))
"""
"""Script that records random drags, contacts, stops, plans and moving water."""

RECORD_PROGRAM = """
import sys
from pathlib import Path
from katana450.extensions.programs.script.script_files import library_file, script_text
from tests.recording.sessions import program, record_session
record_session(Path(sys.argv[1]), int(sys.argv[2]), program(script_text(library_file("pour"))))
"""
"""Script that records a program, which grasps the cup, pours the water and puts the cup back."""

KINDS = {"random": (RECORD, TICKS), "program": (RECORD_PROGRAM, POURING_TICKS)}

NO_SIMD = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL"}
OLD_LIBM = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"}
OTHERS = [
    pytest.param({"OPENBLAS_CORETYPE": "Zen", "PYTHONHASHSEED": "4711", **NO_SIMD}),
    *(
        pytest.param(case, marks=pytest.mark.long)
        for case in (
            {"OPENBLAS_CORETYPE": "SkylakeX"},
            OLD_LIBM,
            {**OLD_LIBM, **NO_SIMD, "OPENBLAS_CORETYPE": "Sandybridge"},
        )
    ),
]


@pytest.fixture(scope="module", params=["random", pytest.param("program", marks=pytest.mark.long)])
def path(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    return recorded(tmp_path_factory.mktemp("portable") / "run.mcap", request.param)


def recorded(path: Path, kind: str) -> Path:
    """Record a session of one of KINDS in a process like those of a server."""
    script, ticks = KINDS[kind]
    # The processes of a server get this environment.
    environment = portable_rounding(os.environ | {"OPENBLAS_CORETYPE": "Haswell"})
    subprocess.run(
        [sys.executable, "-c", script, str(path), str(ticks)], env=environment, check=True
    )
    return path


def test_recording_names_its_rounding(path: Path) -> None:
    with RecordingFile.open(path) as file:
        assert file.metadata[ROUNDING] == PORTABLE


@pytest.mark.parametrize("environment", OTHERS, ids=lambda case: " ".join(case.values()))
def test_simulation_is_identical_on_other_processors(
    path: Path, environment: dict[str, str]
) -> None:
    done = completed(
        [sys.executable, "-P", "-m", "katana450", "record", "verify", str(path)],
        env=environment,
        seconds=600,
    )
    with RecordingFile.open(path) as file:
        ticks = file.counts()[COMMANDS]
    assert ticks > TICKS // 2
    assert f"identical to the bit over {ticks - 1} ticks" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0


def test_another_kind_of_processor_simulates_in_this_process(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A process of its own would not round otherwise, and start one more for the same reason.
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    monkeypatch.setattr(simulation, "_verified_apart", None)
    assert simulation.verified(path).ticks > TICKS // 2


def test_tunables_of_the_user_are_kept_and_ours_come_last() -> None:
    environment = {"GLIBC_TUNABLES": "glibc.malloc.arena_max=2", "HOME": "/root"}
    changed = portable_rounding(environment)
    assert changed["GLIBC_TUNABLES"].startswith("glibc.malloc.arena_max=2:glibc.cpu.hwcaps=-")
    assert changed["HOME"] == "/root"
    assert changed["OPENBLAS_NUM_THREADS"] == "1"
    assert portable_rounding(changed) == changed
    assert rounds_portably(changed)
    assert not rounds_portably(environment)
    assert not rounds_portably(changed | {"OPENBLAS_CORETYPE": "Zen"})


def interpreter(version: str) -> str | None:
    """Return an interpreter of Python ``version``, on the path or of pyenv; None without one."""
    home = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    program = shutil.which(f"python{version}")
    names = [program] if program else []
    names += map(str, sorted((home / "versions").glob(f"{version}.*/bin/python")))
    ask = "import sys; print('%d.%d' % sys.version_info[:2])"
    for name in names:
        done = subprocess.run([name, "-c", ask], capture_output=True, text=True, check=False)
        if done.stdout.strip() == version:
            return name
    return None


@pytest.fixture(scope="session")
def environments(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the virtual environments of other interpreters."""
    return tmp_path_factory.mktemp("environments")


@pytest.mark.long
@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13"])
def test_simulation_is_identical_in_other_pythons(
    path: Path, version: str, environments: Path
) -> None:
    """The locked libraries for running are installed into an environment of the interpreter."""
    name = interpreter(version)
    if name is None:
        pytest.skip(f"There is no Python {version} here.")
    folder, uv = environments / version, Path(sys.executable).with_name("uv")
    python = str(folder / "bin" / "python")
    if not folder.exists():
        for command in (
            ["venv", "--python", name, "--no-python-downloads", str(folder)],
            ["pip", "install", "--python", python, "--requirement", str(LOCK)],
        ):
            subprocess.run([str(uv), "--quiet", *command], check=True, timeout=600)
    done = completed(
        [python, "-P", "-m", "katana450", "record", "verify", str(path)],
        env={"PYTHONPATH": str(ROOT / "app")},
        seconds=600,
    )
    assert "identical to the bit over" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0
