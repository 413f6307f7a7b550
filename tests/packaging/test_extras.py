"""Extras are named with their commands when they are needed, and not before."""

from __future__ import annotations

import pickle
import sys
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from runpy import run_path

import pytest

from katana450 import extras
from katana450.cli.main import main
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.importers.formats.shape_file import Format
from katana450.extensions.importers.guarded_reading import answer
from katana450.extensions.real_arm.driver.katana_driver import driver_of
from katana450.extensions.real_arm.link import open_arm
from katana450.extras import MissingExtraError
from tests.exchange.compressed_gltf import draco_glb
from tests.exchange.test_threemf import threemf

LEARN = Path(extras.__file__).with_name("learn.py")
"""The module that registers the environments of gymnasium."""

SCRIPT = """\
frame: base
tool: tcp
steps:
  - move: {x: 320, y: -100, z: 150, pitch: 50, roll: 0}
  - line: {by: {y: 50}}
"""


def read(data: bytes, format: Format) -> str:
    """Return why the reader refuses ``data``."""
    return answer(data, format, f"a.{format.value}", None, None, "").error


def test_each_missing_extra_is_named_with_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def answered(*words: str) -> str:
        assert main([*words]) == 1
        return capsys.readouterr().err

    def refused(use: Callable[..., object], *arguments: object) -> str:
        with pytest.raises(MissingExtraError) as caught:
            use(*arguments)
        # The processes of a server send it to each other.
        return str(pickle.loads(pickle.dumps(caught.value)))

    arm = (Namespace(device="serial:///dev/ttyUSB0", arm_log=None), None, (), 0.0)
    picture = str(tmp_path / "a.png")
    uses: list[tuple[str, str, Callable[[], str]]] = [
        ("embreex", "pictures", lambda: answered("render", "--out", picture)),
        ("robot_descriptions", "gallery", lambda: answered("serve", "--arm", "ur5e")),
        ("gymnasium", "learn", lambda: refused(run_path, str(LEARN))),
        ("serial", "serial", lambda: refused(open_arm, DeviceAddress("/dev/ttyUSB0", None))),
        ("serial", "serial", lambda: refused(driver_of, *arm)),
        ("DracoPy", "meshes", lambda: read(draco_glb(), Format.GLB)),
        ("networkx", "meshes", lambda: read(threemf(), Format.THREEMF)),
    ]
    wrong = []
    for module, extra, use in uses:
        with monkeypatch.context() as without:
            without.setitem(sys.modules, module, None)
            said = use()
        command = f"{sys.executable} -m pip install {extras.PACKAGES[extra]}"
        if f"the extra {extra!r}: {command}" not in said:
            wrong.append((module, said))
    assert not wrong
    assert not list(tmp_path.iterdir())


def test_environment_without_pip_is_told_of_uv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"uv pip install -p \S+ imageio-ffmpeg"):
        extras.require("imageio_ffmpeg", "films", "Films")


def test_report_without_the_extra_for_pictures_has_the_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script, out = tmp_path / "script.yaml", tmp_path / "out"
    script.write_text(SCRIPT, encoding="utf-8")
    monkeypatch.setitem(sys.modules, "embreex", None)
    assert main(["run", str(script), "--headless", "--report", str(out)]) == 0
    (said,) = (line for line in capsys.readouterr().out.splitlines() if "pip install" in line)
    assert said.startswith("The report has figures, but no pictures of the arm.")
    assert said.endswith("pip install embreex")
    figures = {"path.png", "joints.png", "speeds.png"}
    assert {path.name for path in out.iterdir()} == figures | {
        "report.html", "report.json", "trace.csv"
    }  # fmt: skip
    assert (out / "report.html").read_text(encoding="utf-8").count("data:image/png") == 3
