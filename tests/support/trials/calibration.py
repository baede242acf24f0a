"""Calibration from recorded drives of a real robot: fitted to one session, scored on the others.

The data is not ours and does not ship: `--optiodom FOLDER` names a folder that holds sessions of
the OptiOdom data set, at any depth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from statistics import fmean, stdev

from diffbotctl.blocks.range_sensor import distance_at
from diffbotctl.calibrate import umbmark
from diffbotctl.calibrate.dead_reckoning import EndError, Geometry, end_error, mean_distance
from diffbotctl.calibrate.range_fit import FAR_FROM_M, RULER_DISTANCES_M, RulerPoint, fit_curve
from diffbotctl.calibrate.steps.range import LISTEN_TIME_S
from diffbotctl.plant.range_sensors import CURVE
from tests.support.optiodom_session import OptiodomSession, is_session, read_session
from tests.support.trials.row import NoData, Row

LEARNT_FROM = "231220200029"  # six runs round a square of 1.7 m, half of them clockwise
FIT_LEAST = 6.0  # times better by E_max,syst
UMBMARK_LEAST = 4.0
SHARE_MOST = 0.5  # of the nominal end error, on paths that are no squares
NOT_SQUARE = ("circ", "joy", "straight")  # begin the names of the folders of the other paths
MM = 1000.0


def rows(folders: Sequence[Path]) -> Iterator[Row]:
    """Rows for every session below `folders`; one that states it when there is no data."""
    found = {path.name: path for folder in folders for path in _sessions(folder)}
    if LEARNT_FROM not in found:
        target = f"needs session {LEARNT_FROM}: --optiodom FOLDER"
        yield NoData("calibration from a real robot's log", "no data", target, True)
        return
    learnt = read_session(found.pop(LEARNT_FROM))
    fitted = learnt.fit().geometry
    classic = by_umbmark(learnt)
    for path in found.values():
        session = read_session(path)
        if session.side is None or _is_other_path(path):
            yield _share(session, learnt.nominal, fitted)
        else:
            yield _gain(session, learnt.nominal, fitted, "from-log", FIT_LEAST)
            yield _gain(session, learnt.nominal, classic, "UMBmark", UMBMARK_LEAST)
    if not any(_is_other_path(path) for path in found.values()):
        target = f"<= {SHARE_MOST:g} of nominal; needs such sessions: --optiodom FOLDER"
        yield NoData("from-log: end error on circles and by joystick", "no data", target, True)


def by_umbmark(session: OptiodomSession) -> Geometry:
    """One round of UMBmark on a session of squares: first half clockwise, second counter."""
    if session.side is None:
        raise ValueError("UMBmark needs squares")
    # To first order an end lies at (-2 L (alpha + beta), -2 L (alpha + beta)) clockwise and at
    # (-2 L (alpha - beta), 2 L (alpha - beta)) counter-clockwise.
    clockwise, counter = map(umbmark.mean_end, _ends(session, session.nominal))
    both, other = clockwise.x + clockwise.y, counter.x - counter.y
    angles = umbmark.Angles(
        -(both + other) / (8 * session.side), -(both - other) / (8 * session.side)
    )
    return umbmark.correct_geometry(session.nominal, session.side, angles)


def systematic_error(session: OptiodomSession, geometry: Geometry) -> float:
    """E_max,syst of the session's squares, dead-reckoned with `geometry`; m."""
    return umbmark.systematic_error(*_ends(session, geometry))


def _sessions(folder: Path) -> Iterator[Path]:
    for path in sorted({each.parent for each in folder.rglob("*_metadata.csv")}):
        if is_session(path):
            yield path


def _is_other_path(path: Path) -> bool:
    return any(part.lower().startswith(NOT_SQUARE) for part in path.parts)


def _ends(session: OptiodomSession, geometry: Geometry) -> tuple[list[EndError], list[EndError]]:
    ends = [end_error(drive, geometry) for drive in session.drives]
    half = len(ends) // 2
    return ends[:half], ends[half:]


def _gain(
    session: OptiodomSession, nominal: Geometry, found: Geometry, how: str, least: float
) -> Row:
    before, after = (systematic_error(session, each) * MM for each in (nominal, found))
    figure = f"{before:.1f} -> {after:.1f} mm"
    target = f"{before / after:.1f} times better, >= {least:g}"
    return Row(
        f"{how}: E_max,syst, squares {session.name}", figure, target, before >= least * after
    )


def _share(session: OptiodomSession, nominal: Geometry, found: Geometry) -> Row:
    before, after = (mean_distance(session.drives, each) * MM for each in (nominal, found))
    figure = f"{before:.1f} -> {after:.1f} mm"
    target = f"{after / before:.2f} of the nominal end error, <= {SHARE_MOST:g}"
    return Row(f"from-log: paths {session.name}", figure, target, after <= SHARE_MOST * before)


TELEMETRY = 40  # readings a second
OFFSET, NOISE = 0.15, 0.010  # V, of parts, and of one reading
PARTS = 300
NEAR_MOST, FAR_MOST = 3.0, 2.0  # mm to 20 cm, % beyond


def range_rows(seed: int) -> Iterator[Row]:
    """A distance sensor's curve through six ruler points, judged on all points of the data sheet
    from 4 to 30 cm: exact, on parts with an offset, and with noise averaged as the step does."""
    rng = Random(f"{seed} range")
    offsets = [rng.uniform(-OFFSET, OFFSET) for _ in range(PARTS)]
    noisy = [_range_errors(offset, NOISE, rng) for offset in offsets]
    for what, errors in (
        ("exact", [_range_errors(0.0, 0.0, rng)]),
        ("parts off by 0.15 V, exact", [_range_errors(s * OFFSET, 0.0, rng) for s in (-1, 1)]),
        (f"{PARTS} parts, 10 mV of noise", noisy),
    ):
        near, far = (max(each[place] for each in errors) for place in (0, 1))
        figure = f"{near:.1f} mm, {far:.1f} %"
        target = f"<= {NEAR_MOST:g} mm to 20 cm, <= {FAR_MOST:g} % beyond"
        yield Row(f"range fit, {what}", figure, target, near <= NEAR_MOST and far <= FAR_MOST)


def _range_errors(offset: float, noise: float, rng: Random) -> tuple[float, float]:
    """The largest errors, in mm to 20 cm and in % beyond."""
    sheet = {place: volts + offset for place, volts in CURVE if 0.04 <= place <= 0.30}
    readings = round(LISTEN_TIME_S * TELEMETRY)
    points = []
    for place in RULER_DISTANCES_M:
        received = [sheet[place] + rng.gauss(0.0, noise) for _ in range(readings)]
        points.append(RulerPoint(place, fmean(received), stdev(received), readings))
    found = fit_curve(points)
    wrong = {
        place: abs(distance_at(volts, found.a, found.b, found.c) - place)
        for place, volts in sheet.items()
    }
    near = max(error for place, error in wrong.items() if place <= FAR_FROM_M) * MM
    far = max(error / place for place, error in wrong.items() if place > FAR_FROM_M) * 100
    return near, far
