"""The benchmark of files of other people reads, drives and refuses what it should."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.foreign_urdfs import result_of, table
from tests.general_arms.links_of_arms import ur5e

SLIDE = """<robot name="slide"><link name="a"/><link name="b"/>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.1" velocity="1" effort="1"/></joint></robot>"""


def test_files_are_driven_or_refused_with_a_reason(tmp_path: Path) -> None:
    texts = {"ur5e": ur5e(), "slide": SLIDE, "broken": "<robot"}
    rng, results = np.random.default_rng(1), {}
    for name, text in texts.items():
        path = tmp_path / f"{name}.urdf"
        path.write_text(text, encoding="utf-8")
        results[path] = result_of(path, rng)
    arm, slide, broken = results.values()
    assert (arm.kind, arm.step) == ("by its tool", True)
    assert arm.rounding is not None
    assert arm.rounding < 1e-9
    assert len(arm.postures) == 5
    assert (slide.kind, slide.step) == ("joint by joint", None)
    assert broken.kind == "refused"
    assert "broken.urdf" in broken.detail
    text = table(results, tmp_path)
    assert "| ur5e.urdf | by its tool | closed form for six axes, three of them parallel |" in text
    assert "1 of 1 tools made their step" in text
