"""The pose from which a scan fits a map best: search, then refinement, with the odometry as prior.

Search: Olson 2009, "Real-time correlative scan matching". Refinement: distances of points to the
lines through their neighbours (Censi 2008, "An ICP variant using a point-to-line metric").
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.lidar_scan import SurfacePoints
from diffbotctl.mapping.match_field import CELL, FULL, MatchField
from diffbotctl.mapping.plane_pose import Array, rotated, transformed, wrapped

SEARCH_STEP = 2  # cells
SEARCH_TURN = 0.02  # rad
SEARCH_POINTS = 180
PRIOR_WEIGHT = 0.02  # of half the squared deviation from the prior, against the score of 0 to 1
POINT_SIGMA = 0.03  # m, of a point beside the line through the points of the map
INDEPENDENT = 0.3  # share of the points whose errors are independent of their neighbours'
ITERATIONS = 12
GATE_FIRST, GATE_LAST = 0.25, 0.10  # m; points further from their line are not used
FEATURELESS = 0.02  # ratio of information along the walls and across them
SEARCH_MAX = (0.5, 0.35)  # m, rad


class ScanFit(NamedTuple):
    """A pose and how well the scan fits there."""

    pose: Array
    information: Array
    """3 x 3, of the scan alone, for x and y along the axes of the map"""
    overlap: float
    """share of the points that lie at a line of the map"""


def search(field: MatchField, points: Array, prior: Array, covariance: Array) -> Array:
    """The best pose on a lattice within 3 sigma of `prior`.

    `covariance`: of the prior, 3 x 3, x and y along the axes of the map.
    """
    sigma = np.sqrt(np.diag(covariance))
    reach = np.minimum(3 * sigma, [SEARCH_MAX[0], SEARCH_MAX[0], SEARCH_MAX[1]])
    counts = np.ceil(reach / [SEARCH_STEP * CELL, SEARCH_STEP * CELL, SEARCH_TURN]).astype(int)
    if not len(points) or not counts.any():
        return prior
    points = points[:: -(-len(points) // SEARCH_POINTS)]
    turns = SEARCH_TURN * np.arange(-counts[2], counts[2] + 1)
    rows = SEARCH_STEP * np.arange(-counts[0], counts[0] + 1)
    columns = SEARCH_STEP * np.arange(-counts[1], counts[1] + 1)
    seen = np.stack([rotated(points, float(prior[2]) + turn) for turn in turns]) + prior[:2]
    cell = np.floor((seen - field.low) / CELL).astype(np.int64)
    margin = SEARCH_STEP * counts[:2]
    shape = (field.rows, field.columns)
    inside = ((cell >= margin) & (cell < shape - margin)).all(-1)
    first = cell[..., 0] * field.columns + cell[..., 1]
    score = np.empty((len(turns), len(rows), len(columns)))
    for i, row in enumerate(rows.tolist()):
        for j, column in enumerate(columns.tolist()):
            index = np.where(inside, first + (row * field.columns + column), 0)
            score[:, i, j] = field.likelihood[index].sum(1, dtype=np.int64)
    score /= FULL * len(points)
    offsets = np.stack(np.meshgrid(turns, CELL * rows, CELL * columns, indexing="ij"), -1)
    offsets = offsets[..., [1, 2, 0]]
    deviation = np.einsum("...i,ij,...j->...", offsets, np.linalg.inv(covariance), offsets)
    best = np.unravel_index(int((score - PRIOR_WEIGHT * 0.5 * deviation).argmax()), score.shape)
    found: Array = prior + offsets[best]
    return found


def refine(
    field: MatchField, scan: SurfacePoints, start: Array, prior: Array, covariance: Array
) -> ScanFit:
    """Gauss-Newton from `start` on the distances of points to lines and on the prior.

    Far points count less (Cauchy weights) and, beyond a gate that narrows, nothing.
    """
    pose = np.array(start, float)
    weight_prior = np.linalg.inv(covariance)
    information = np.zeros((3, 3))
    overlap = 0.0
    gate = GATE_FIRST
    surface = field.surface
    for iteration in range(ITERATIONS):
        arm = rotated(scan.points, float(pose[2]))
        nearest = field.nearest[field.cells(arm + pose[:2])]
        used = np.flatnonzero(nearest >= 0)
        used = used[surface.is_flat[nearest[used]]]
        normal = surface.normals[nearest[used]]
        offset = arm[used] + pose[:2] - surface.points[nearest[used]]
        distance = (offset * normal).sum(1)
        near = (np.abs(distance) < gate) & (np.hypot(*offset.T) < gate + 0.1)
        used, normal, distance = used[near], normal[near], distance[near]
        arm = arm[used]
        lever = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
        slope = np.column_stack([normal, lever])
        weight = INDEPENDENT / POINT_SIGMA**2 / (1 + (distance / (1.5 * POINT_SIGMA)) ** 2)
        information = (slope * weight[:, None]).T @ slope
        seen = _seen(information)
        information = seen @ information @ seen
        deviation = pose - prior
        deviation[2] = wrapped(deviation[2])
        pull = -seen @ (slope * weight[:, None]).T @ distance - weight_prior @ deviation
        step = np.linalg.solve(information + weight_prior, pull)
        pose = pose + step
        overlap = len(used) / max(1, len(scan.points))
        gate = max(GATE_LAST, 0.8 * gate)
        if np.abs(step).max() < 3e-4 and iteration > 2:
            break
    pose[2] = wrapped(pose[2])
    return ScanFit(pose, information, overlap)


def _seen(information: Array) -> Array:
    """Projection that removes the direction of x and y in which the scan has no features.

    Along a corridor only noise of the directions of surfaces is left, and does not average out
    (Zhang, Kaess and Singh 2016, "On degeneracy of optimization-based state estimation problems").
    """
    values, vectors = np.linalg.eigh(information[:2, :2])
    projection = np.eye(3)
    if values[0] < FEATURELESS * values[1]:
        projection[:2, :2] -= np.outer(vectors[:, 0], vectors[:, 0])
    return projection


def match(field: MatchField, scan: SurfacePoints, prior: Array, covariance: Array) -> ScanFit:
    """The pose of `scan` in the map `field`, near `prior` within 3 sigma of its `covariance`."""
    start = search(field, scan.points, prior, covariance)
    return refine(field, scan, start, prior, covariance)


def explained(field: MatchField, scan: SurfacePoints, pose: Array) -> float:
    """Share of the points within 15 cm of a point of the map."""
    if not len(scan.points):
        return 0.0
    values = field.likelihood[field.cells(transformed(scan.points, pose))]
    return float((values > 0.17 * FULL).mean())
