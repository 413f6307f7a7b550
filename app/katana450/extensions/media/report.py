"""The files of a report: figures, a table of the run, and its measures as JSON and HTML."""

from __future__ import annotations

import base64
import csv
import html
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from katana450.atomic import write_files, writer_of
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.media import figures
from katana450.extensions.media.measures import (
    Bound,
    PourRecord,
    bounds,
    measurements,
    traced_paths,
)
from katana450.extensions.programs.run.simulation import Simulation
from katana450.extensions.programs.script.measures import (
    MEASURES,
    path_fraction,
    title_of,
    unit_of,
)
from katana450.extensions.programs.script.script import Script
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward

NONE: Mapping[str, bytes] = {}
"""The pictures of a report without pictures."""


@dataclass(frozen=True, eq=False)
class Report:
    """The report of one run.

    Attributes:
        script: the script.
        run: the run.
        values: each measure by its name.
        bounds: the bounds that the script expects.
        facts: conditions of the run, by name.
        notes: notes for people.
    """

    script: Script
    run: Simulation
    values: dict[str, float | None]
    bounds: tuple[Bound, ...]
    facts: dict[str, Any]
    notes: tuple[str, ...]

    @staticmethod
    def of(
        script: Script,
        run: Simulation,
        facts: dict[str, Any],
        notes: tuple[str, ...] = (),
    ) -> Report:
        """Return the report with all measures."""
        values = measurements(run)
        return Report(script, run, values, bounds(script, values), facts, notes)

    @property
    def missed(self) -> list[Bound]:
        """The bounds that are not met."""
        return [bound for bound in self.bounds if not bound.held]

    @property
    def lines(self) -> list[str]:
        """The measures as text lines."""
        return [
            f"{title_of(name):<32} {_with_unit(name, value)}" for name, value in self.values.items()
        ]

    def json(self, written: datetime) -> str:
        """Return all measures, with units in the names, and their bounds as JSON."""
        expected = [
            {
                "name": bound.name,
                "at_least": bound.low if np.isfinite(bound.low) else None,
                "at_most": bound.high if np.isfinite(bound.high) else None,
                "value": bound.value,
                "held": bound.held,
            }
            for bound in self.bounds
        ]
        entries = {
            **self.values,
            "bounds_held": not self.missed,
            "bounds": expected,
            "script": self.script.name,
            **self.facts,
            "notes": list(self.notes),
            "written": written.isoformat(timespec="seconds"),
        }
        return json.dumps(entries, indent=2, ensure_ascii=False) + "\n"

    @cached_property
    def _pour(self) -> PourRecord | None:
        return PourRecord.of(self.run)

    def csv(self) -> str:
        """Return one row per tick: time, step, line, task, joints, speeds, fingers, tool, path.

        With water also the columns of `PourRecord`. Each number has all its digits, so that reading
        gives the same.
        """
        run, pour = self.run, self._pour
        tasks = [run.program.tasks[number] for number in run.tasks.tolist()]
        slides, fingers = run.arm.gripper.slides, [state.gripper for state in run.states]
        columns: dict[str, Iterable[Any]] = {
            "t_s": run.t,
            "step": [task.number + 1 for task in tasks],
            "line": [task.line for task in tasks],
            "task": [task.name for task in tasks],
            **_of_joints(run.q, "theta{}_deg"),
            **_of_joints(run.qd, "theta{}_deg_s"),
            "fingers_mm" if slides else "fingers_deg": (
                1e3 * np.array(fingers) if slides else np.degrees(fingers)
            ),
            "tool": [state.tool for state in run.states],
            **self._of_tool(run.q),
            "path_fraction": [path_fraction(state) for state in run.states],
            **({} if pour is None else pour.columns),
        }
        file = io.StringIO()
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            rows.writerow(map(_cell, row))
        return file.getvalue()

    def _of_tool(self, q: FloatArray) -> dict[str, FloatArray]:
        """Return the columns of the tool point at ``q`` (N, n) [rad]."""
        chains = (self.run.arm.chain_to(state.tool) for state in self.run.states)
        points = [1e3 * forward(chain, row)[:3, 3] for chain, row in zip(chains, q, strict=True)]
        x, y, z = np.transpose(points)
        return {"x_mm": x, "y_mm": y, "z_mm": z}

    def write(
        self, directory: Path, written: datetime, pictures: Mapping[str, bytes] = NONE
    ) -> tuple[Path, ...]:
        """Write all files into ``directory``, which is created if needed. Raises InputError.

        ``pictures`` are PNG files by names of CAPTIONS, shown before the figures.
        """
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"{directory} cannot be created: {error.strerror or error}."
            ) from error
        paths = traced_paths(self.run)
        images = dict(pictures)
        if paths:
            images["path.png"] = figures.path_figure(paths)
        images["joints.png"] = figures.joints_figure(self.run)
        images["speeds.png"] = figures.speeds_figure(self.run)
        if self._pour is not None:
            images["water.png"] = figures.water_figure(self._pour)
        contents = {
            "report.html": self._page(images, written).encode(),
            "report.json": self.json(written).encode(),
            "trace.csv": self.csv().encode(),
            **images,
        }
        writers = {directory / name: writer_of(content) for name, content in contents.items()}
        write_files(writers)
        return tuple(writers)

    def _page(self, images: dict[str, bytes], written: datetime) -> str:
        captions = CAPTIONS if "emptying.png" in images else CAPTIONS | OF_OTHER_OBJECTS
        shown = "\n".join(
            f'<figure><img alt="{captions[name][0]}" '
            f'src="data:image/png;base64,{base64.b64encode(image).decode()}">'
            f"<figcaption>{captions[name][1]}</figcaption></figure>"
            for name, image in images.items()
        )
        tables = f"<h2>Measured</h2>\n<table>\n{_rows(self.values)}\n</table>"
        checks = "\n".join(
            f'<li class="{"held" if bound.held else "missed"}">{title_of(bound.name)}: '
            f"{_with_unit(bound.name, bound.value)}; {bound.wanted}</li>"
            for bound in self.bounds
        )
        verdict = "Every bound is met." if self.bounds else "The script expects no bounds."
        if self.missed:
            verdict = "A bound is not met."
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        facts = " · ".join(
            f"{name.replace('_', ' ')} {value:g}" if isinstance(value, float) else f"{name} {value}"
            for name, value in self.facts.items()
        )
        return PAGE.format(
            name=html.escape(self.script.name),
            about=f"<p>{html.escape(self.script.about)}</p>" if self.script.about else "",
            verdict=verdict,
            result="missed" if self.missed else "held",
            figures=shown,
            tables=tables,
            checks=checks,
            notes=notes,
            facts=html.escape(facts),
            written=written.strftime("%d %B %Y, %H:%M"),
        )


OF_OTHER_OBJECTS = {
    "grasping.png": ("The fingers closed on the object", "Grasping the object."),
}
CAPTIONS = {
    "initial.png": ("The arm before it moves", "Initial configuration."),
    "grasping.png": ("The fingers closed on the cup", "Grasping the cup."),
    "approaching.png": ("The full cup over the basin", "Approaching the basin."),
    "emptying.png": ("Water running from the cup into the basin", "Emptying the cup."),
    "tracing.png": (
        "The arm on its path",
        "The arm on the path. Grey: the desired path. In colour: the part traced by the tool.",
    ),
    "path.png": (
        "Desired and traced path in 3D, and the error along it",
        (
            "Left: the desired path and that of forward kinematics on the planned joints, in "
            "the shoulder frame; dots are the starts of paths. Right: the distance between them, "
            "the maximum in each half percent of all paths."
        ),
    ),
    "joints.png": (
        "Joint angles over time",
        "The setpoints of the arm, a hundred per second.",
    ),
    "speeds.png": (
        "Joint speeds against their limits, and speed of the tool",
        "Above: joint speeds as fractions of their limits; dashed: the limits. Below: the tool.",
    ),
    "water.png": (
        "Water in cup and basin, flow, tilt of the cup and height of its lip over time",
        (
            "Above: volumes in the cup, in the basin and spilled, and the flow out of the cup. "
            "Below: the tilt of the cup, and the height of its lip above the water; at 0 it pours."
        ),
    ),
}
"""Alternative text and caption of each figure."""

PAGE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{name} · katana450</title>
<style>
:root {{ color-scheme: light dark; --ink: #1f2933; --soft: #52606d; --page: #f7f8fa;
  --card: #fff; --line: #d9dee4; --held: #15803d; --missed: #b91c1c; }}
@media (prefers-color-scheme: dark) {{ :root {{ --ink: #e6eaef; --soft: #9fb0c0; --page: #14181d;
  --card: #1d232a; --line: #323b45; --held: #4ade80; --missed: #f87171; }} }}
body {{ margin: 0 auto; padding: 1.5rem 1rem 3rem; max-width: 50rem; background: var(--page);
  color: var(--ink); font: 1rem/1.5 system-ui, sans-serif; }}
h1 {{ margin: 0; font-size: 1.7rem; }}
h2 {{ margin: 2rem 0 .5rem; font-size: 1.1rem; }}
p {{ margin: .4rem 0; }}
.verdict {{ font-weight: 600; }}
.held {{ color: var(--held); }} .missed {{ color: var(--missed); }}
figure {{ margin: 1.2rem 0; padding: .8rem; background: #fff; border-radius: .6rem;
  border: 1px solid var(--line); }}
img {{ display: block; width: 100%; height: auto; }}
figcaption {{ margin-top: .5rem; color: #52606d; font-size: .85rem; }}
table {{ width: 100%; border-collapse: collapse; background: var(--card); border-radius: .6rem; }}
th, td {{ padding: .45rem .7rem; border-bottom: 1px solid var(--line); text-align: left;
  font-weight: 500; vertical-align: top; }}
td {{ text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }}
small {{ display: block; color: var(--soft); font-weight: 400; }}
ul {{ padding-left: 1.2rem; }}
footer {{ margin-top: 2rem; color: var(--soft); font-size: .85rem; }}
</style>
<h1>{name}</h1>
{about}
<p class="verdict {result}">{verdict}</p>
{notes}
{figures}
{tables}
<h2>Expected</h2>
<ul>
{checks}
</ul>
<footer>katana450 · {facts} · {written}</footer>
</html>
"""
"""Template of the HTML page."""


def _of_joints(values: FloatArray, name: str) -> dict[str, FloatArray]:
    """Return the columns of ``values`` (N, n) [rad], in degrees, by ``name`` with the axis."""
    return {name.format(axis): np.degrees(row) for axis, row in enumerate(values.T, 1)}


def _cell(value: Any) -> Any:
    """Return ``value`` for a table: all digits of a number, and nothing for an unknown one."""
    if not isinstance(value, float):
        return value
    return "" if math.isnan(value) else repr(float(value))


def _rows(values: Mapping[str, float | None]) -> str:
    return "\n".join(
        f"<tr><th>{title_of(name)}<small>{MEASURES[name]}</small></th>"
        f"<td>{_with_unit(name, value)}</td></tr>"
        for name, value in values.items()
    )


def _with_unit(name: str, value: float | None) -> str:
    """Return a measure with its unit as text."""
    return "none" if value is None else f"{_shown(value)} {unit_of(name)}".rstrip()


def _shown(value: float) -> str:
    return f"{value:.2e}" if value != 0.0 and abs(value) < 1e-3 else f"{value:.4g}"
