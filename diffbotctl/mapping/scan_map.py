"""A map: scans and the pose of the robot at each of them, or a grid that came from elsewhere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diffbotctl.mapping.grid_surface import free_corners, grid_surface
from diffbotctl.mapping.lidar_scan import MappedScan, surface_points
from diffbotctl.mapping.match_field import MatchField, joined
from diffbotctl.mapping.occupancy_grid import GridBuilder, OccupancyGrid
from diffbotctl.mapping.plane_pose import Array

FIELD_SCANS = 400


class Map(NamedTuple):
    """What `map_file` saves and loads. Frame: map (REP-105)."""

    resolution: float
    """m, of a cell of its grid"""
    scans: tuple[MappedScan, ...]
    """in the order of time"""
    poses: Array
    """N x 3: base_link in map at each of `scans`"""
    imported: OccupancyGrid | None = None
    """in place of scans"""

    def corners(self) -> Array:
        """2 x 2: lowest and highest x and y at which a robot has been, or can be."""
        if self.imported is not None:
            return free_corners(self.imported)
        return np.array([self.poses[:, :2].min(0), self.poses[:, :2].max(0)])

    def drawn(self) -> GridBuilder:
        """The log-odds of all cells."""
        if self.imported is not None:
            return GridBuilder.of(self.imported)
        builder = GridBuilder(self.resolution)
        for scan, pose in zip(self.scans, self.poses, strict=True):
            builder.insert(scan, pose)
        return builder

    def grid(self) -> OccupancyGrid:
        """The cells: those that were imported, or those that all scans give."""
        return self.imported or self.drawn().grid()

    def field(self) -> MatchField:
        """Of the whole map, from at most FIELD_SCANS scans."""
        if self.imported is not None:
            return MatchField(grid_surface(self.imported))
        part = slice(None, None, -(-len(self.scans) // FIELD_SCANS) or 1)
        surfaces = [surface_points(scan.points, scan.origin) for scan in self.scans[part]]
        return MatchField(joined(surfaces, self.poses[part]))
