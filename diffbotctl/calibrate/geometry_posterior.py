"""Posterior of wheel diameters and track, given the measured ends of drives.

The unknowns are the natural logarithms of mean diameter, wheel ratio and track: for a robot of any
size, 1 % of each has the same weight. They are found by Gauss-Newton iterations; the noise of the
ends is averaged over (end_noise.py), and each drive may have been measured or noted wrongly with a
small probability, as in a mixture model (Box & Tiao, "A Bayesian approach to some outlier
problems", Biometrika 55, 1968), so that one wrong end does not spoil the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, log, pi

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats, Geometry, Segment
from diffbotctl.calibrate.end_noise import UNKNOWN_VARIANCE, Linearized, NoiseGrid, linearize

ITERATIONS_MAX = 30
STEP_TOLERANCE = 1e-7
LOG_STEP_MAX = 0.1  # the linearization does not hold further
REACH_MIN_M = 0.05
# Relative standard deviations of what the robot file states, by measuring with a ruler.
DIAMETER_SD = 0.02
RATIO_SD, TRACK_SD = 0.10, 0.30


@dataclass(frozen=True, slots=True)
class WrongEnds:
    """What is known beforehand of drives whose ends were measured or noted wrongly."""

    probability: float
    reach_ratio: float  # of the distance rolled, within which a wrong end lies anywhere


RECORDED = WrongEnds(0.08, 1.0)


@dataclass(frozen=True, slots=True)
class GeometryPrior:
    """The stated geometry, and relative standard deviations of mean, ratio and track."""

    stated: Geometry
    sds: tuple[float, float, float] = (DIAMETER_SD, RATIO_SD, TRACK_SD)

    @property
    def precision(self) -> Floats:
        """(3, 3)"""
        return np.diag(1 / np.square(self.sds))

    def offset(self, geometry: Geometry) -> Floats:
        """(3,): logarithms of `geometry` over the stated one."""
        stated = self.stated
        ratios = (geometry.mean / stated.mean, geometry.ratio / stated.ratio)
        return np.array([log(ratio) for ratio in (*ratios, geometry.track / stated.track)])

    def log_density(self, geometry: Geometry) -> float:
        """Of `geometry`, not normalized."""
        return float(-0.5 * ((self.offset(geometry) / self.sds) ** 2).sum())


@dataclass(frozen=True, slots=True)
class Solution:
    """The most likely geometry."""

    geometry: Geometry
    score: float  # logarithm of the evidence, by the posterior around this geometry
    good: Floats  # (segments,): probability that each end is not wrong


@dataclass(frozen=True, slots=True)
class Posterior:
    """Mean and covariance of the logarithms of mean diameter, ratio and track."""

    geometry: Geometry
    covariance: Floats  # (3, 3)
    share: Floats  # (combinations,): probability of each combination of the noise
    noise: NoiseGrid  # one combination, of the expected values

    def with_mean(self, mean: float) -> Posterior:
        """The posterior given this mean diameter (m); its covariance is kept."""
        change = log(mean / self.geometry.mean)
        step = self.covariance[:, 0] / self.covariance[0, 0] * change
        return replace(self, geometry=apply_log_step(self.geometry, step))

    def wider(self, covariance: Floats) -> Posterior:
        """The posterior with a further error of this `covariance` (3, 3)."""
        return replace(self, covariance=self.covariance + covariance)


def apply_log_step(geometry: Geometry, step: Floats) -> Geometry:
    """`geometry` with the logarithms of mean, ratio and track increased by `step`."""
    mean, ratio, track = map(exp, step)
    scaled = Geometry(geometry.right * mean, geometry.left * mean, geometry.track)
    return scaled.reshaped(geometry.ratio * ratio, geometry.track * track)


def solve(
    segments: Sequence[Segment],
    weights: Floats,
    start: Geometry,
    prior: GeometryPrior,
    noise: NoiseGrid,
    wrong_ends: WrongEnds = RECORDED,
) -> Solution:
    """The most likely geometry near `start`; `weights` (segments,) discount overlapping segments.

    Expectation maximization over the noise and over wrong ends, with Gauss-Newton steps.
    """
    geometry, step = start, np.full(3, np.inf)
    wrong = log_wrong_density(segments, start, wrong_ends)
    right = log(1 - wrong_ends.probability)
    for _ in range(ITERATIONS_MAX):
        linear = linearize(segments, geometry)
        log_likelihood, good, precisions = _expect(linear, weights, noise, right, wrong)
        jacobians, residuals = linear.jacobians, linear.residuals
        normal = prior.precision + np.einsum("nki,nkl,nlj->ij", jacobians, precisions, jacobians)
        if np.abs(step).max() < STEP_TOLERANCE:
            break
        gradient = prior.precision @ prior.offset(geometry)
        gradient += np.einsum("nki,nkl,nl->i", jacobians, precisions, residuals)
        step = np.clip(-np.linalg.solve(normal, gradient), -LOG_STEP_MAX, LOG_STEP_MAX)
        geometry = apply_log_step(geometry, step)
    # Laplace's approximation of the evidence: one good point among many bad ones proves little.
    score = log_likelihood + prior.log_density(geometry) - 0.5 * np.linalg.slogdet(normal)[1]
    return Solution(geometry, float(score), good)


def _expect(
    linear: Linearized, weights: Floats, noise: NoiseGrid, log_right: float, wrong: Floats
) -> tuple[float, Floats, Floats]:
    """Logarithm of the likelihood, and for each segment the probability that its end is not wrong
    and the expected inverse covariance (3, 3)."""
    covariances = linear.covariances(noise)
    right = log_right + linear.log_densities(covariances)
    mixture = np.logaddexp(right, wrong)
    logs = noise.log_prior + mixture @ weights
    total = float(np.logaddexp.reduce(logs))
    responsibility = np.exp(logs - total)[:, None] * np.exp(right - mixture)
    precisions = np.einsum("gn,gnij->nij", responsibility * weights, np.linalg.inv(covariances))
    return total, responsibility.sum(axis=0), precisions


def log_wrong_density(
    segments: Sequence[Segment], geometry: Geometry, wrong_ends: WrongEnds
) -> Floats:
    """(segments,): density of an end that has nothing to do with the drive, and its probability."""
    logs = []
    for segment in segments:
        rolled = float(np.abs(segment.rolled).sum(axis=0).max()) * geometry.mean
        radius = max(wrong_ends.reach_ratio * rolled, REACH_MIN_M)
        has_place, _, has_heading = np.isfinite(segment.motion)
        place = 1 / (pi * radius**2) if has_place else 1 / (2 * pi * UNKNOWN_VARIANCE)
        heading = 1 / (2 * pi) if has_heading else 1 / (2 * pi * UNKNOWN_VARIANCE) ** 0.5
        # Beyond the reach the density falls with the cube of the distance: a unit may be wrong.
        distance = float(np.hypot(*segment.motion[:2])) if has_place else 0.0
        beyond = max(distance / radius, 1.0)
        logs.append(log(heading * place) - 3 * log(beyond))
    return np.array(logs) + log(wrong_ends.probability)


def posterior(
    segments: Sequence[Segment],
    weights: Floats,
    geometry: Geometry,
    prior: GeometryPrior,
    noise: NoiseGrid,
) -> Posterior:
    """The posterior of drives without wrong ends; `geometry` is near its maximum.

    For each combination of noise the posterior is normal; their mixture is returned by its mean and
    covariance.
    """
    linear = linearize(segments, geometry)
    covariances = linear.covariances(noise)
    inverses = np.linalg.inv(covariances) * weights[None, :, None, None]
    jacobians, residuals = linear.jacobians, linear.residuals
    normal = prior.precision + np.einsum("nki,gnkl,nlj->gij", jacobians, inverses, jacobians)
    gradient = prior.precision @ prior.offset(geometry)
    gradient = gradient + np.einsum("nki,gnkl,nl->gi", jacobians, inverses, residuals)
    steps = -np.linalg.solve(normal, gradient[..., None])[..., 0]
    # Evidence of each combination, with the geometry integrated out.
    logs = noise.log_prior + linear.log_densities(covariances) @ weights
    logs = logs - 0.5 * (gradient * steps).sum(axis=1) - 0.5 * np.linalg.slogdet(normal)[1]
    share = np.exp(logs - np.logaddexp.reduce(logs))
    mean = share @ steps
    deviations = steps - mean
    covariance = np.einsum("g,gij->ij", share, np.linalg.inv(normal))
    covariance += np.einsum("g,gi,gj->ij", share, deviations, deviations)
    return Posterior(
        apply_log_step(geometry, mean), np.asarray(covariance), share, noise.expected(share)
    )
