"""A map: the scans that it was built from, and the pose of the robot at each of them."""

from __future__ import annotations

from typing import NamedTuple

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

    def drawn(self) -> GridBuilder:
        """The log-odds that all scans give."""
        builder = GridBuilder(self.resolution)
        for scan, pose in zip(self.scans, self.poses, strict=True):
            builder.insert(scan, pose)
        return builder

    def grid(self, version: int = 1) -> OccupancyGrid:
        """The grid that all scans give."""
        return self.drawn().grid(version)

    def field(self) -> MatchField:
        """Of the whole map, from at most FIELD_SCANS scans."""
        part = slice(None, None, -(-len(self.scans) // FIELD_SCANS) or 1)
        surfaces = [surface_points(scan.points, scan.origin) for scan in self.scans[part]]
        return MatchField(joined(surfaces, self.poses[part]))
