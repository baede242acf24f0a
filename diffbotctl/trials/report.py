"""The report of trials: one HTML file that needs no other, with all paths, the worst first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise
from math import isfinite
from pathlib import Path

from diffbotctl.config.configuration import Configuration
from diffbotctl.trials.plan import Trial, TrialsPlan
from diffbotctl.trials.statistics import proven_share
from diffbotctl.trials.summary import case_rows, watch_command, worst_first
from diffbotctl.trials.verdict import JudgedRun

SIZE = 120  # of a picture, in its own units
MARGIN = 6
EXTENT_MIN_M = 0.5
MARK = "<!-- diffbotctl -->"  # by which the file may be overwritten

STYLE = """
:root{color-scheme:light dark;--bg:#fff;--fg:#1a1d21;--soft:#5b6470;--line:#d5dae0;--good:#1b7f4b;
--bad:#c22f2f;--path:#2563c4;--tile:#f6f8fa}
@media(prefers-color-scheme:dark){:root{--bg:#14171a;--fg:#e6e9ec;--soft:#9aa4b0;--line:#343a42;
--good:#4cc38a;--bad:#ff7b72;--path:#7ab1ff;--tile:#1c2126}}
body{margin:0 auto;max-width:76rem;padding:1rem;background:var(--bg);color:var(--fg);
font:15px/1.45 system-ui,sans-serif}
h1{font-size:1.3rem}h2{font-size:1.05rem;margin-top:2rem}
.scroll{overflow-x:auto}table{border-collapse:collapse}
th,td{padding:.25rem .8rem .25rem 0;text-align:right;border-bottom:1px solid var(--line);
white-space:nowrap}th:first-child,td:first-child{text-align:left}th{color:var(--soft);
font-weight:normal}
.runs{display:grid;grid-template-columns:repeat(auto-fill,minmax(10.5rem,1fr));gap:.7rem}
.run{background:var(--tile);border:1px solid var(--line);border-left:4px solid var(--good);
border-radius:4px;padding:.4rem .5rem;min-width:0}.run.bad{border-left-color:var(--bad)}
.run svg{width:100%;height:auto;display:block}.run b,.run p,.run code{overflow-wrap:anywhere}
.run b{font-size:.8rem}.run p{margin:.2rem 0;font-size:.78rem;color:var(--soft)}
.run.bad p.why{color:var(--bad)}summary{cursor:pointer;font-size:.75rem;color:var(--soft)}
code{font-size:.72rem;user-select:all}
.p{fill:none;stroke:var(--path);stroke-width:1.5}.w{stroke:var(--soft);stroke-width:2;fill:none}
.o{fill:var(--soft)}.g{fill:none;stroke:var(--good);stroke-width:1.5}.s{fill:var(--soft)}
.e{fill:var(--path)}
"""


def html(plan: TrialsPlan, judged: Sequence[JudgedRun], seconds: float) -> str:
    """The whole report; `seconds` is how long the trials took."""
    return "".join(_parts(plan, judged, seconds))


def _parts(plan: TrialsPlan, judged: Sequence[JudgedRun], seconds: float) -> Iterator[str]:
    passed = sum(each.passed for each in judged)
    name = escape(str(plan.file))
    yield f'<!doctype html>\n{MARK}\n<html lang="en"><head><meta charset="utf-8">'
    yield '<meta name="viewport" content="width=device-width,initial-scale=1">'
    yield f"<title>{passed} of {len(judged)} runs as expected: {name}</title>"
    yield f"<style>{STYLE}</style></head><body>\n<h1>{name}: {passed} of {len(judged)} runs as "
    yield "expected</h1>\n"
    yield f"<p>Simulated runs of the pipeline {escape(plan.section.pipeline)}, in {seconds:.0f} s. "
    yield f"{passed} of {len(judged)} proves, with 95 % confidence, that at least "
    yield f"{100.0 * proven_share(passed, len(judged)):.0f} % of all such runs end as expected.</p>"
    yield '\n<div class="scroll"><table>'
    for number, row in enumerate(case_rows(judged)):
        cell = "td" if number else "th"
        yield f"<tr>{''.join(f'<{cell}>{escape(text)}</{cell}>' for text in row)}</tr>\n"
    yield "</table></div>\n<h2>All runs, the worst first</h2>\n"
    yield "<p>Grey: the start, walls and obstacles. Green circle: a goal. Blue: where the robot "
    yield 'really drove.</p>\n<div class="runs">\n'
    trials = {trial.name: trial for trial in plan.trials}
    for each in sorted(worst_first(judged), key=lambda each: each.passed):
        yield _tile(plan.file, trials[each.result.name], each)
    yield "</div></body></html>\n"


def _tile(file: Path, trial: Trial, judged: JudgedRun) -> str:
    found = judged.result
    figures = [found.outcome.replace("_", " "), f"{found.time:.1f} s"]
    if found.error is not None:
        figures.append(f"{found.error * 1000:.0f} mm off")
    why = "".join(f'<p class="why">{escape(text)}</p>' for text in judged.unmet)
    command = escape(watch_command(file, found.name))
    name = escape(found.name).replace("/", "/<wbr>")  # where it may be broken
    return (
        f'<div class="run{"" if judged.passed else " bad"}"><b>{name}</b>'
        f"{_picture(trial, judged)}<p>{escape(', '.join(figures))}</p>{why}"
        f"<details><summary>seed {found.seed}: show it</summary><code>{command}</code></details>"
        "</div>\n"
    )


class _Scale:
    """From metres to the picture: what was driven, and the goals, with a margin around."""

    def __init__(self, points: Sequence[tuple[float, float]]) -> None:
        xs, ys = [x for x, _ in points], [y for _, y in points]
        extent = max(max(xs) - min(xs), max(ys) - min(ys), EXTENT_MIN_M)
        self.unit = (SIZE - 2 * MARGIN) / extent
        self._x, self._y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2

    def at(self, x: float, y: float) -> tuple[int, int]:
        half = SIZE / 2
        return round(half + (x - self._x) * self.unit), round(half - (y - self._y) * self.unit)


def _picture(trial: Trial, judged: JudgedRun) -> str:
    """The path of a run as SVG, with the world and the goals, in odom."""
    path = [point for point in judged.result.path if all(map(isfinite, point))] or [(0.0, 0.0)]
    goals = [(goal.x, goal.y) for goal in trial.goals or trial.configuration.goals]
    scale = _Scale([*path, *goals, (0.0, 0.0)])
    points = [scale.at(*point) for point in path]
    steps = [f"{x - before_x} {y - before_y}" for (before_x, before_y), (x, y) in pairwise(points)]
    line = f"M{points[0][0]} {points[0][1]}l{' '.join(steps)}" if steps else ""
    start, end = scale.at(0.0, 0.0), points[-1]
    marks = [f'<circle class="s" cx="{start[0]}" cy="{start[1]}" r="3"/>']
    places = [scale.at(*goal) for goal in goals]
    marks += [f'<circle class="g" cx="{x}" cy="{y}" r="5"/>' for x, y in places]
    marks += [f'<circle class="e" cx="{end[0]}" cy="{end[1]}" r="3"/>']
    label = f"Path of the run {escape(trial.name)}"
    return (
        f'<svg viewBox="0 0 {SIZE} {SIZE}" role="img" aria-label="{label}">'
        f'{_world(trial.configuration, scale)}<path class="p" d="{line}"/>{"".join(marks)}</svg>'
    )


def _world(configuration: Configuration, scale: _Scale) -> str:
    robot, world = configuration.robot, configuration.world
    start = robot.simulation.start if robot is not None else None
    if start is not None and any((start.x, start.y, start.heading)):
        return ""  # the world has another frame than the path
    lines = []
    for wall in world.walls:
        (x1, y1), (x2, y2) = scale.at(*wall.start), scale.at(*wall.end)
        lines.append(f'<path class="w" d="M{x1} {y1}L{x2} {y2}"/>')
    for each in world.obstacles:
        x, y = scale.at(*each.at)
        lines.append(f'<circle class="o" cx="{x}" cy="{y}" r="{each.radius * scale.unit:.0f}"/>')
    return "".join(lines)
