"""Verify that what a server records can be simulated to the bit on other processors.

Other processors are imitated by the variables that make BLAS, libm and numpy choose code for them.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from katana450.extensions.recording.files import verifying
from katana450.extensions.recording.files.fingerprint import PORTABLE, ROUNDING
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.topics import COMMANDS
from katana450.portable_rounding import portable_rounding, rounds_portably
from tests.conftest import LONG

TICKS = 3000 if LONG else 300

RECORD = """
import sys
from pathlib import Path
from tests.recording.recorded import record
record(Path(sys.argv[1]), int(sys.argv[2]))
"""

NO_SIMD = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL"}
OLD_LIBM = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"}
OTHERS = [
    pytest.param({"OPENBLAS_CORETYPE": "Zen", "PYTHONHASHSEED": "4711", **NO_SIMD}),
    *(
        pytest.param(each, marks=pytest.mark.long)
        for each in (
            {"PYTHONHASHSEED": "0"},
            {"PYTHONHASHSEED": "1"},
            {"OPENBLAS_CORETYPE": "Haswell"},
            {"OPENBLAS_CORETYPE": "SkylakeX"},
            {"OPENBLAS_CORETYPE": "Sandybridge"},
            OLD_LIBM,
            {**OLD_LIBM, **NO_SIMD, "OPENBLAS_CORETYPE": "Sandybridge"},
        )
    ),
]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("portable") / "run.mcap"
    # The processes of a server get this environment.
    environment = portable_rounding(os.environ | {"OPENBLAS_CORETYPE": "Haswell"})
    subprocess.run(
        [sys.executable, "-c", RECORD, str(made), str(TICKS)], env=environment, check=True
    )
    return made


def test_recording_names_its_rounding(path: Path) -> None:
    with RecordingFile.open(path) as file:
        assert file.metadata[ROUNDING] == PORTABLE
        assert file.metadata["blas_core"] == "Nehalem"


@pytest.mark.parametrize("environment", OTHERS, ids=lambda each: " ".join(each.values()))
def test_simulation_is_identical_on_other_processors(
    path: Path, environment: dict[str, str]
) -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "katana450", "record", "verify", str(path)],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
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
    monkeypatch.setattr(verifying, "_verified_apart", None)
    assert verifying.verified(path).ticks > TICKS // 2


def test_tunables_of_the_user_are_kept_and_ours_come_last() -> None:
    given = {"GLIBC_TUNABLES": "glibc.malloc.arena_max=2", "HOME": "/root"}
    found = portable_rounding(given)
    assert found["GLIBC_TUNABLES"].startswith("glibc.malloc.arena_max=2:glibc.cpu.hwcaps=-")
    assert found["HOME"] == "/root"
    assert portable_rounding(found) == found
    assert rounds_portably(found)
    assert not rounds_portably(given)
    assert not rounds_portably(found | {"OPENBLAS_CORETYPE": "Zen"})
