"""``katana450 workspace`` as a person runs it: a process, files, an interrupt."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from katana450.cli.main import main
from katana450.extensions.reachability import map as map_module
from katana450.extensions.reachability import workspace as workspace_module
from katana450.extensions.reachability.reachability_file import load_map
from tests.general_arms.links_of_arms import ur5e

ROOT = Path(__file__).resolve().parents[2]
COARSE = ("--voxel", "250")


def test_a_map_is_written_and_summed_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "map.npz"
    assert main(["workspace", *COARSE, "--tool", "grasp", "--out", str(out)]) == 0
    printed = capsys.readouterr()
    stored = load_map(out)
    assert f"The tool grasp reaches {len(stored.points)} voxels of 250 mm" in printed.out
    assert f"{stored.fraction.max():.1%}" in printed.out
    assert f"Written: {out}" in printed.out
    assert printed.err == ""
    assert sorted(tmp_path.iterdir()) == [out]
    assert (stored.robot, stored.tool) == ("katana450", "grasp")
    assert stored.voxel == pytest.approx(0.25)


def test_map_that_takes_too_long_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = tmp_path / "ur5e.urdf"
    urdf.write_text(ur5e())
    assert main(["workspace", "--urdf", str(urdf), "--voxel", "2"]) == 1
    assert "Choose larger voxels than 2 mm" in capsys.readouterr().err


def test_the_same_command_writes_the_same_bytes(tmp_path: Path) -> None:
    one, two = tmp_path / "one.npz", tmp_path / "two.npz"
    for path in (one, two):
        assert main(["workspace", *COARSE, "--out", str(path)]) == 0
    assert one.read_bytes() == two.read_bytes()


def test_all_cores_write_the_same_bytes_as_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_module, "POSES", 4000)
    paths = [tmp_path / name for name in ("one.npz", "all.npz")]
    for path, minimum in zip(paths, (10**6, 2), strict=True):
        monkeypatch.setattr(workspace_module, "MIN_SHARED_CHUNKS", minimum)
        assert main(["workspace", *COARSE, "--out", str(path)]) == 0
    one, shared = (path.read_bytes() for path in paths)
    assert one == shared


def test_a_table_removes_the_space_below(tmp_path: Path) -> None:
    out = tmp_path / "map.npz"
    assert main(["workspace", *COARSE, "--table", "300", "--out", str(out)]) == 0
    assert load_map(out).points[:, 2].min() >= 0.3
    with np.load(out) as arrays:
        assert arrays["table"].item() == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tool", "hammer"], "no link 'hammer'"),
        (["--table", "2000"], "reaches up to"),
        (["--table", "nan"], "leaves no reachable"),
        (["--voxel", "0"], "edge of a voxel"),
        (["--voxel", "-5"], "edge of a voxel"),
        (["--voxel", "inf"], "edge of a voxel"),
        (["--out", "map.txt"], "must end in .npz"),
        (["--out", "/nowhere/at/all/map.npz"], "no directory"),
    ],
)
def test_impossible_options_are_refused_before_the_work(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    start = time.monotonic()
    assert main(["workspace", *options]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith("katana450: ")
    assert message in printed.err
    assert printed.out == ""
    assert time.monotonic() - start < 5.0


def test_a_value_that_is_no_number_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        main(["workspace", "--voxel", "big"])
    assert exit_.value.code == 2
    assert "--voxel" in capsys.readouterr().err


@pytest.mark.long
def test_an_interrupt_leaves_nothing_behind(tmp_path: Path) -> None:
    """Interrupt a map that takes minutes, on a terminal of its own, so that the bar is drawn."""
    master, slave = os.openpty()
    out = tmp_path / "map.npz"
    command = [sys.executable, "-m", "katana450", "workspace", "--voxel", "5", "--out", str(out)]
    with (
        closing(os.fdopen(master, "rb", buffering=0)) as terminal,
        subprocess.Popen(command, cwd=ROOT, stderr=slave, stdout=subprocess.PIPE) as process,
    ):
        os.close(slave)
        try:
            seen = b""
            while b"Mapping" not in seen:
                seen += terminal.read(1024)
            process.send_signal(signal.SIGINT)
            stdout, _ = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 130
    assert stdout == b""
    assert list(tmp_path.iterdir()) == []
