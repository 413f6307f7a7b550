"""A page that shows recordings beside each other: table, speed over time, and paths of the tool."""

from __future__ import annotations

import html
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from katana450.extensions.programs.measures import unit_of
from katana450.extensions.recording.scoring.leaderboard import Leaderboard, name_of, shown
from katana450.extensions.recording.scoring.scored import MEASURES, Scored
from katana450.maths.geometry.arrays import FloatArray

COLOURS = 6
"""Number of colours; further recordings begin again with the first."""

POINTS = 600
"""Maximum number of points of a curve."""

WIDTH, SPEED_HEIGHT, PATH_HEIGHT, LEFT, BOTTOM, TOP = 760.0, 220.0, 300.0, 46.0, 34.0, 12.0
"""[px] Size and margins of the figures."""

DOTTED = " Dotted: the path of the tool as it was measured."
"""Explanation of the paths of measured arms."""

TICKS = 5
"""Approximate number of labels on an axis."""


def score_page(board: Leaderboard, written: datetime) -> str:
    """Return a page without other files, in light and dark, of the recordings of ``board``."""
    head = "".join(
        f'<th scope="col"><i class="c{number % COLOURS}"></i>'
        f"{f'{number + 1}. ' if len(board.rows) > 1 else ''}{html.escape(each.name)}</th>"
        for number, each in enumerate(board.rows)
    )
    rows = "\n".join(_row(board, measure) for measure in board.measures)
    speeds = [(each.t, 1e3 * each.speed) for each in board.rows]
    half = 0.5 * (WIDTH - 20.0)
    views = [
        _figure(
            f"Path of the tool seen from {side}",
            [(1e3 * each.tool[:, 0], 1e3 * each.tool[:, up]) for each in board.rows],
            "x, mm",
            f"{'xyz'[up]}, mm",
            half,
            PATH_HEIGHT,
            measured=[
                (1e3 * each.measured[:, 0], 1e3 * each.measured[:, up]) for each in board.rows
            ],
        )
        for side, up in (("above", 1), ("the side", 2))
    ]
    names = ", ".join(each.name for each in board.rows)
    return PAGE.format(
        title=html.escape(names if len(names) < 80 else f"{len(board.rows)} recordings"),
        colours=_colours(),
        head=head,
        rows=rows,
        legend=_legend(board.rows),
        speed=_figure("Speed of the tool over time", speeds, "s", "mm/s", WIDTH, SPEED_HEIGHT),
        views="".join(views),
        dotted=DOTTED if any(len(each.measured) for each in board.rows) else "",
        written=f"{written:%d %B %Y, %H:%M}",
    )


def _row(board: Leaderboard, measure: str) -> str:
    cells = "".join(
        f'<td class="best">{shown(each.values[measure])}<b> best</b></td>'
        if board.is_best(each, measure)
        else f"<td>{shown(each.values[measure])}</td>"
        for each in board.rows
    )
    unit = unit_of(measure)
    title = name_of(measure) + (f", {unit}" if unit else "")
    return f'<tr><th scope="row">{title}<small>{MEASURES[measure]}</small></th>{cells}</tr>'


def _colours() -> str:
    """Return the rules that colour marks and curves."""
    return "".join(
        f"i.c{n} {{ background: var(--c{n}); }} polyline.c{n} {{ stroke: var(--c{n}); }} "
        f"circle.c{n} {{ fill: var(--c{n}); }}\n"
        for n in range(COLOURS)
    )


def _legend(rows: Sequence[Scored]) -> str:
    return "".join(
        f'<span><i class="c{number % COLOURS}"></i>{html.escape(each.name)}</span>'
        for number, each in enumerate(rows)
    )


def _figure(
    title: str,
    curves: Sequence[tuple[FloatArray, FloatArray]],
    across: str,
    up: str,
    width: float,
    height: float,
    measured: Sequence[tuple[FloatArray, FloatArray]] | None = None,
) -> str:
    """Return a figure of ``curves``.

    ``measured``: of paths, that of each as it was measured, empty if it was not. Paths have one
    scale for both axes, and a dot at their begin.
    """
    equal = measured is not None
    x, y = (np.concatenate([curve[axis] for curve in curves]) for axis in (0, 1))
    low = np.array((float(x.min()), float(y.min()) if equal else 0.0))
    high = np.array((float(x.max()), float(y.max())))
    span = np.maximum(high - low, 1e-9) * (1.08 if equal else 1.0)
    room = np.array((width - LEFT - 8.0, height - BOTTOM - TOP))
    scale = np.full(2, (room / span).min()) if equal else room / span
    middle = 0.5 * (low + high)
    low = middle - 0.5 * room / scale if equal else low
    origin = np.array((LEFT, height - BOTTOM))

    def place(points: FloatArray) -> FloatArray:
        return np.asarray(origin + (points - low) * scale * (1.0, -1.0))

    def drawn(x: FloatArray, y: FloatArray) -> str:
        points = place(np.stack((x, y), axis=1)[:: max(len(x) // POINTS, 1)])
        return " ".join(f"{px:.1f},{py:.1f}" for px, py in points.tolist())

    lines = []
    for number, each in enumerate(curves):
        lines.append(f'<polyline class="c{number % COLOURS}" points="{drawn(*each)}"/>')
        if equal:
            bx, by = place(np.array((each[0][0], each[1][0]))).tolist()
            colour = f"c{number % COLOURS}"
            lines.append(f'<circle class="{colour}" cx="{bx:.1f}" cy="{by:.1f}" r="4"/>')
    dotted = "".join(
        f'<polyline class="c{number % COLOURS}" points="{drawn(*each)}"/>'
        for number, each in enumerate(measured or ())
        if len(each[0])
    )
    lines.append(f'<g class="measured">{dotted}</g>' if dotted else "")
    marks = []
    for value in _ticks(low[0], low[0] + room[0] / scale[0]):
        px = float(place(np.array((value, low[1])))[0])
        marks.append(
            f'<path d="M{px:.1f} {TOP}V{height - BOTTOM}"/>'
            f'<text x="{px:.1f}" y="{height - BOTTOM + 15:.0f}" text-anchor="middle">'
            f"{value:g}</text>"
        )
    for value in _ticks(low[1], low[1] + room[1] / scale[1]):
        py = float(place(np.array((low[0], value)))[1])
        marks.append(
            f'<path d="M{LEFT} {py:.1f}H{width - 8}"/>'
            f'<text x="{LEFT - 6}" y="{py + 4:.1f}" text-anchor="end">{value:g}</text>'
        )
    return (
        f"<figure><figcaption>{title}<small>{up} over {across}</small></figcaption>"
        f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{title}">'
        f'<g class="grid">{"".join(marks)}</g>{"".join(lines)}</svg></figure>'
    )


def _ticks(low: float, high: float) -> list[float]:
    """Return round values from ``low`` to ``high``."""
    rough = (high - low) / TICKS
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(power * each for each in (1.0, 2.0, 5.0, 10.0) if power * each >= rough)
    first = np.ceil(low / step - 1e-9)
    found = [float(step * (first + number)) for number in range(3 * TICKS)]
    return [round(each, 9) + 0.0 for each in found if each <= high + 1e-9]


PAGE = """\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Score: {title} · katana450</title>
<style>
:root {{ color-scheme: light dark; --ink: #1f2933; --soft: #52606d; --page: #f7f8fa;
  --card: #fff; --line: #d9dee4; --best: #15803d;
  --c0: #1d4ed8; --c1: #c2410c; --c2: #15803d; --c3: #7e22ce; --c4: #0e7490; --c5: #a16207; }}
@media (prefers-color-scheme: dark) {{ :root {{ --ink: #e6eaef; --soft: #9fb0c0; --page: #14181d;
  --card: #1d232a; --line: #323b45; --best: #4ade80;
  --c0: #7aa7ff; --c1: #fb923c; --c2: #4ade80; --c3: #c084fc; --c4: #22d3ee; --c5: #facc15; }} }}
* {{ box-sizing: border-box; }}
body {{ margin: 0 auto; padding: 1.5rem 1rem 3rem; max-width: 60rem; background: var(--page);
  color: var(--ink); font: 1rem/1.5 system-ui, sans-serif; }}
h1 {{ margin: 0 0 1rem; font-size: 1.6rem; }}
.table {{ overflow-x: auto; background: var(--card); border: 1px solid var(--line);
  border-radius: .6rem; }}
table {{ width: 100%; border-collapse: collapse; }}
th, td {{ padding: .4rem .8rem; border-bottom: 1px solid var(--line); text-align: left;
  font-weight: 500; vertical-align: top; }}
tbody tr:last-child > * {{ border-bottom: 0; }}
thead th {{ white-space: nowrap; }}
thead th + th, td {{ text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums; }}
tbody th {{ min-width: 13rem; }}
small {{ display: block; color: var(--soft); font-weight: 400; font-size: .85rem; }}
.best {{ color: var(--best); font-weight: 700; }}
.best b {{ font-size: .75rem; font-weight: 600; }}
i {{ display: inline-block; width: .75em; height: .75em; margin-right: .4em;
  border-radius: .2em; }}
.legend {{ display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; margin: 1.5rem 0 .6rem; }}
figure {{ margin: 0; padding: .8rem; background: var(--card);
  border: 1px solid var(--line); border-radius: .6rem; }}
.figures {{ display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }}
figure:first-child {{ grid-column: 1 / -1; }}
figcaption {{ font-weight: 600; margin-bottom: .3rem; }}
svg {{ display: block; width: 100%; height: auto; }}
.grid path {{ stroke: var(--line); fill: none; }}
.grid text {{ fill: var(--soft); font-size: 12px; }}
polyline {{ fill: none; stroke-width: 2; stroke-linejoin: round; }}
polyline:nth-of-type(even) {{ stroke-dasharray: 7 5; }}
.measured polyline {{ stroke: var(--ink); stroke-width: 1; stroke-dasharray: 1 3; }}
@media (max-width: 40rem) {{ .figures {{ grid-template-columns: 1fr; }} td b, th small {{
  display: none; }} tbody th {{ min-width: 8rem; }} th, td {{ padding: .4rem .5rem; }}
  table {{ font-size: .9rem; }} thead th + th {{ white-space: normal; overflow-wrap: anywhere; }}
  figure:first-child .grid text {{ font-size: 20px; }} }}
{colours}footer {{ margin-top: 2rem; color: var(--soft); font-size: .85rem; }}
</style>
<h1>Score</h1>
<div class="table"><table>
<thead><tr><th scope="col">Measure</th>{head}</tr></thead>
<tbody>
{rows}
</tbody>
</table></div>
<p class="legend">{legend}</p>
<div class="figures">{speed}{views}</div>
<footer>A dot marks the beginning of a path.{dotted} Made by katana450, {written}.</footer>
</html>
"""
"""Template of the page."""
