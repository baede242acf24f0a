"""Maps of what a lidar sees: scan matching, pose graph, relocalisation, occupancy grid, files.

Needs numpy. Pure: no clock, no randomness; the same scans give the same answers bit for bit. Only
`map_file` and `map_image` read and write files.
"""
