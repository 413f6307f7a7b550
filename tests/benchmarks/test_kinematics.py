"""The kinematics benchmark measures the advertised quantities; the tests need no peer."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import kinematics_report as report
from benchmarks.kinematics import BATCH, ONE_BY_ONE, ROOT, main, measure, seeded_task
from benchmarks.kinematics_arms import SEVEN, SIX
from benchmarks.kinematics_own import Floor, chain_of
from benchmarks.kinematics_process import SolverError, SolverProcess
from benchmarks.kinematics_quality import quality
from benchmarks.kinematics_report import Tables
from benchmarks.kinematics_task import SOLVED_POSITION, Task
from benchmarks.kinematics_worker import SOLVERS
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse import inverse

POSES = 12
HERE = Path(sys.executable)

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


@pytest.fixture(scope="module")
def tables() -> Tables:
    """Return the tables of a short run without peers."""
    return measure(POSES, 2, 1, ROOT / "nowhere", ["katana450", "floor"])


def test_the_app_solves_every_pose_with_every_branch(tables: Tables) -> None:
    (row,) = tables.one_by_one
    assert row.failed == ""
    assert row.quality is not None
    assert row.quality.solved == row.quality.usable == 1.0
    assert row.quality.branches == 4.0
    assert 1.0 <= row.quality.inside <= 4.0
    assert row.quality.worst < 1e-12
    assert row.microseconds.shape == (2,)
    assert (row.microseconds > 0.0).all()
    assert row.ratios.tolist() == [1.0, 1.0]


@needs_compiler
def test_the_same_form_in_c_gives_the_same_angles() -> None:
    chain, task = seeded_task(200, 3)
    floor = Floor(task)
    for T, q in zip(task.T, floor.joints_batch(floor.solve_batch(task.T)), strict=True):
        expected = np.array([solution.q for solution in inverse(chain, T)])
        assert np.allclose(q, expected, rtol=0.0, atol=1e-7)


@needs_compiler
def test_the_batch_table_holds_the_floor_and_the_app(tables: Tables) -> None:
    floor, own = tables.batch
    assert floor.failed == own.failed == ""
    assert floor.ratios.tolist() == [1.0, 1.0]
    assert np.allclose(own.ratios, own.microseconds / floor.microseconds)


def test_the_task_is_the_same_after_saving(tmp_path: Path) -> None:
    chain, task = seeded_task(3, 5)
    task.save(tmp_path / "task.npz")
    other = Task.load(tmp_path / "task.npz")
    assert other.letters == "zyyyx"
    again = chain_of(other)
    q = np.array([0.3, -0.9, 0.8, 0.4, 1.0])
    assert np.allclose(forward(again, q), forward(chain, q), atol=1e-15)
    assert np.array_equal(other.T, task.T)


def test_the_poses_follow_from_the_seed() -> None:
    assert np.array_equal(seeded_task(4, 8)[1].T, seeded_task(4, 8)[1].T)
    assert not np.array_equal(seeded_task(4, 8)[1].T, seeded_task(4, 9)[1].T)


def test_wrong_answers_and_doubles_do_not_count() -> None:
    chain, task = seeded_task(1, 2)
    right = inverse(chain, task.T[0])[0].q
    turned = right + np.array([2.0 * np.pi, 0.0, 0.0, 0.0, 0.0])
    wrong = right + np.array([0.0, 2.0 * SOLVED_POSITION, 0.0, 0.0, 2e-5])
    found = quality(chain, task.T, [np.array([right, turned, wrong])])
    assert found.branches == 1.0
    assert found.worst > 1e-7
    missed = quality(chain, task.T, [np.array([wrong])])
    assert missed.solved == missed.branches == missed.usable == 0.0
    assert quality(chain, task.T, [np.empty((0, 5))]).solved == 0.0


@pytest.mark.long
def test_a_peer_that_cannot_be_installed_is_listed_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Run without network and cache, so that nothing can be installed."""
    monkeypatch.setenv("UV_OFFLINE", "1")
    monkeypatch.setenv("UV_NO_CACHE", "1")
    tables = measure(2, 1, 1, tmp_path / "peers", ["katana450", "eaik"])
    _, single = tables.one_by_one
    _, batch = tables.batch
    assert "could not be installed" in single.failed
    # With a Python for which a pinned package is not known, it says that there is no solution.
    reasons = ("offline", "network", "no solution")
    assert any(reason in single.failed.lower() for reason in reasons)
    assert batch.failed == single.failed
    for written in (report.text(tables), report.markdown(tables)):
        assert written.count("could not be installed") == 2
    assert report.record(tables)["batch"][1] == {"solver": "EAIK, 1 thread", "failed": batch.failed}


def test_a_peer_that_cannot_be_imported_is_an_error(tmp_path: Path) -> None:
    """Use the app's own environment, which has no peer."""
    seeded_task(2, 1)[1].save(tmp_path / "task.npz")
    for name, module in (("eaik", "eaik"), ("pinocchio", "pinocchio"), ("mink-free", "mink")):
        with pytest.raises(SolverError, match=rf"ModuleNotFoundError.*{module}"):
            SolverProcess(HERE, name, tmp_path / "task.npz", ROOT)


@needs_compiler
def test_a_solver_that_dies_is_an_error(tmp_path: Path) -> None:
    """Ask the floor for a single pose: it solves only batches, so it fails and ends."""
    seeded_task(2, 1)[1].save(tmp_path / "task.npz")
    with SolverProcess(HERE, "floor", tmp_path / "task.npz", ROOT) as process:
        with pytest.raises(SolverError, match="AttributeError"):
            process.solve(0, 2)
        with pytest.raises(SolverError, match="ended"):
            process.solve(0, 2)


def test_the_tables_go_between_the_marks(tables: Tables, tmp_path: Path) -> None:
    document = tmp_path / "benchmarks.md"
    document.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n", encoding="utf-8")
    report.write_into(document, tables)
    first = document.read_text(encoding="utf-8")
    assert "old" not in first
    assert first.startswith("before\n")
    assert first.endswith("\nafter\n")
    assert "| katana450 `inverse` |" in first
    report.write_into(document, tables)
    assert document.read_text(encoding="utf-8") == first
    document.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="must hold the lines"):
        report.write_into(document, tables)


def test_the_command_prints_both_tables_and_writes_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--poses", "4", "--blocks", "2", "--solvers", "katana450", "floor")
    written = ("--json", str(tmp_path / "figures.json"))
    monkeypatch.setattr(sys, "argv", ["kinematics", *options, *written])
    main()
    printed = capsys.readouterr().out
    assert "One pose a call" in printed
    assert "in one call" in printed
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    (row,) = figures["one_by_one"]
    assert row["solver"] == "katana450 `inverse`"
    assert row["least_microseconds"] == min(row["microseconds"])
    assert {row["solver"] for row in figures["batch"]} == {"C, `-O3`", "katana450"}


def test_every_solver_has_a_table_and_a_maker() -> None:
    entries = (*ONE_BY_ONE, *BATCH, *SIX, *SEVEN)
    assert {entry.name for entry in entries} == set(SOLVERS)
