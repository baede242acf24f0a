"""Map files, and pictures for and from ROS's map_server."""

import os
import tracemalloc

import numpy as np
import pytest
import yaml

from diffbotctl.errors import RunError
from diffbotctl.mapping.grid_surface import grid_surface
from diffbotctl.mapping.map_file import load_map, map_bytes, save_map
from diffbotctl.mapping.map_image import load_picture, save_picture
from diffbotctl.mapping.mapper import Mapper, MapperParameters
from diffbotctl.mapping.occupancy_grid import OccupancyGrid
from diffbotctl.mapping.scan_map import Map
from tests.support.rooms import Robot, box, polyline


@pytest.fixture(scope="module")
def room_map():
    mapper = Mapper(MapperParameters())
    for scan in Robot(box(0, 0, 4, 3)).drive(polyline([(1, 1), (3, 1), (3, 2)], 0.1, 0.3)):
        mapper.add(scan)
    return mapper.map()


def imported(grid):
    return Map(grid.resolution, (), np.zeros((0, 3)), grid)


def test_a_saved_map_is_loaded_as_it_was(room_map, tmp_path):
    save_map(room_map, tmp_path / "room.map")
    loaded = load_map(tmp_path / "room.map")
    assert loaded.poses == pytest.approx(room_map.poses)
    for before, after in zip(room_map.scans, loaded.scans, strict=True):
        assert after.points == pytest.approx(before.points, abs=1e-6)
        assert (after.number, after.time, after.origin) == (
            before.number,
            before.time,
            before.origin,
        )
    assert map_bytes(loaded) == map_bytes(room_map)
    assert [each.name for each in tmp_path.iterdir()] == ["room.map"]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_a_part_of_a_file_is_refused(room_map, tmp_path, share):
    content = map_bytes(room_map)
    path = tmp_path / "part.map"
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(RunError, match="E-MAP-FILE"):
        load_map(path)


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_file_is_a_map_or_is_refused(room_map, tmp_path, seed):
    random = np.random.default_rng(seed)
    content = bytearray(map_bytes(room_map))
    for _ in range(3):
        content[random.integers(len(content))] = random.integers(256)
    path = tmp_path / "damaged.map"
    path.write_bytes(bytes(content))
    try:
        load_map(path)
    except RunError as error:
        assert "E-MAP-FILE" in str(error)


@pytest.mark.parametrize("far", [900.0, 99_000.0])
def test_a_map_too_large_to_hold_is_refused(room_map, tmp_path, far):
    poses = room_map.poses.copy()
    poses[-1, :2] = far
    path = tmp_path / "large.map"
    save_map(room_map._replace(poses=poses), path)
    tracemalloc.start()
    with pytest.raises(RunError, match=r"spans \d+ m x \d+ m, more than"):
        load_map(path)
    assert tracemalloc.get_traced_memory()[1] < 40e6
    tracemalloc.stop()


def test_a_large_picture_is_refused_by_its_header(tmp_path):
    (tmp_path / "a.yaml").write_text("image: a.pgm\n")
    with (tmp_path / "a.pgm").open("wb") as picture:
        picture.write(b"P5 10000 10000 255\n")
        picture.truncate(100_000_020)
    tracemalloc.start()
    with pytest.raises(RunError, match="10000 x 10000 cells"):
        load_picture(tmp_path / "a.yaml")
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


def test_a_grid_survives_map_server_s_files(room_map, tmp_path):
    grid = room_map.grid()
    save_picture(grid, tmp_path / "room.yaml")
    loaded = load_picture(tmp_path / "room.yaml")
    assert loaded.resolution == pytest.approx(grid.resolution)
    assert loaded.origin == pytest.approx(grid.origin)
    assert ((loaded.cells == 100) == (grid.cells >= 65)).all()
    assert ((loaded.cells == 0) == ((grid.cells >= 0) & (grid.cells <= 25))).all()


def test_an_imported_map_is_exported_as_it_was(room_map, tmp_path):
    save_picture(room_map.grid(), tmp_path / "room.yaml")
    grid = load_picture(tmp_path / "room.yaml")
    save_map(imported(grid), tmp_path / "room.npz")
    loaded = load_map(tmp_path / "room.npz")
    save_picture(loaded.grid(), tmp_path / "again.yaml")
    assert (tmp_path / "again.pgm").read_bytes() == (tmp_path / "room.pgm").read_bytes()
    again = (tmp_path / "again.yaml").read_text().replace("again", "room")
    assert again == (tmp_path / "room.yaml").read_text()
    drawn = loaded.drawn().grid()
    assert (drawn.origin, drawn.cells.shape) == (grid.origin, grid.cells.shape)
    assert ((drawn.cells >= 65) == (grid.cells == 100)).all()
    assert ((drawn.cells == -1) == (grid.cells == -1)).all()


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2, 2.5])
def test_the_surface_of_a_grid_faces_as_its_wall_does(turn):
    y, x = (np.indices((120, 120)) + 0.5) * 0.05 - 3.0
    across = np.cos(turn) * y - np.sin(turn) * x
    cells = np.where(across > 0.5, -1, np.where(across > 0.4, 100, 0)).astype(np.int8)
    surface = grid_surface(OccupancyGrid(0.05, (-3.0, -3.0), cells))
    assert surface.is_flat.mean() > 0.9
    normals = surface.normals[surface.is_flat]
    assert np.abs(normals @ [-np.sin(turn), np.cos(turn)]).min() > 0.97
    assert np.abs(surface.points @ [-np.sin(turn), np.cos(turn)] - 0.43).max() < 0.04


@pytest.mark.parametrize("seed", range(20))
def test_a_damaged_imported_map_is_refused_or_can_be_searched(room_map, tmp_path, seed):
    random = np.random.default_rng(seed)
    content = bytearray(map_bytes(imported(room_map.grid())))
    content[random.integers(len(content))] = random.integers(256)
    path = tmp_path / "damaged.npz"
    path.write_bytes(bytes(content))
    try:
        loaded = load_map(path)
    except RunError as error:
        assert "E-MAP-FILE" in str(error)
    else:
        assert Mapper(MapperParameters(), loaded).grid().cells.size


def picture_read(folder, picture, keys):
    (folder / "a.pgm").write_bytes(picture)
    (folder / "a.yaml").write_text(
        f"image: a.pgm\nresolution: 0.1\norigin: [-1.0, 2.0, 0.0]\n{keys}\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return load_picture(folder / "a.yaml")


@pytest.mark.parametrize(
    ("header", "greys"),
    [
        (b"P5\n3 1\n#x\n255\n", (0, 205, 254)),
        (b"P5#a\n3#b\n#c\n1 # d\n\t255\n", (0, 205, 254)),
        (b"P5 3 1 100\n", (0, 80, 100)),
        (b"P5 3 1 1\n", (0, 1, 1)),
    ],
)
def test_comments_and_any_highest_grey_of_8_bits_are_read(tmp_path, header, greys):
    cells = picture_read(tmp_path, header + bytes(greys), "negate: 0").cells.tolist()
    assert cells == [[100, 0 if greys[1] == 1 else -1, 0]]


# Greys of a row, by the rules of wiki.ros.org/map_server.
@pytest.mark.parametrize(
    ("keys", "cells"),
    [
        ("mode: trinary\nnegate: 0", [100, -1, -1, 0]),
        ("negate: 1", [0, -1, 100, 100]),
        ("mode: scale\nnegate: 0", [100, 77, 0, 0]),
        ("mode: raw\nnegate: 0", [0, 100, -1, -1]),
    ],
)
def test_pictures_are_read_by_the_rules_of_map_server(tmp_path, keys, cells):
    greys = {"trinary": [0, 100, 205, 254], "scale": [0, 115, 205, 254]}
    row = greys["scale" if "scale" in keys else "trinary"]
    grid = picture_read(tmp_path, b"P5\n# a comment\n4 1\n255\n" + bytes(row), keys)
    assert isinstance(grid, OccupancyGrid)
    assert (grid.resolution, grid.origin) == (0.1, (-1.0, 2.0))
    assert grid.cells.tolist() == [cells]


WHOLE = {
    "image": "a.pgm",
    "resolution": 0.1,
    "origin": [0, 0, 0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


@pytest.mark.parametrize(
    ("keys", "picture", "cause"),
    [
        ({"origin": None}, b"P5 2 1 255\n\0\xff", "origin is missing"),
        ({"image": "b.pgm"}, b"", "b.pgm"),
        ({}, b"P2 1 1 255\n0", "no binary pgm"),
        ({}, b"P5 10000 10000 255\n", "16,000,000"),
        ({}, b"P5 0 10 255\n", "0 x 10 cells"),
        ({}, b"P5 10 10 255\n0", "of 100 bytes"),
        ({}, b"P5 2 1 65535\n\0\0\0\0", "8 bits a cell"),
        ({}, b"P5 2 1 0\n\0\0", "highest grey is 0"),
        ({"negate": float("inf")}, b"P5 2 1 255\n\0\xff", "cannot be read"),
        ({"mode": ["grey"]}, b"P5 2 1 255\n\0\xff", "cannot be read"),
        ({"image": "fifo"}, b"", "a device, a pipe"),
        ({"image": "/dev/zero"}, b"", "a device, a pipe"),
        ({"origin": [0, 0, 0.5]}, b"P5 2 1 255\n\0\xff", "turned by 0.5 rad"),
        ({"mode": "grey"}, b"P5 2 1 255\n\0\xff", "mode is grey"),
        ({"resolution": float("nan")}, b"P5 2 1 255\n\0\xff", "resolution nan"),
        ({"resolution": 1.0}, b"P5 4000 4000 255\n" + bytes(16_000_000), "spans 4000 m"),
        ({"free_thresh": 0.7}, b"P5 2 1 255\n\0\xff", "not below occupied_thresh"),
        ({}, b"P5 2 1 255\n\xff\xff", "look at negate"),
        ({"origin": "here"}, b"P5 2 1 255\n\0\xff", "cannot be read"),
    ],
)
def test_what_is_no_map_of_map_server_is_refused(tmp_path, keys, picture, cause):
    fields = {name: value for name, value in (WHOLE | keys).items() if value is not None}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(fields))
    (tmp_path / "a.pgm").write_bytes(picture)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(RunError) as raised:
        load_picture(tmp_path / "a.yaml")
    assert cause in " ".join(str(raised.value).split())


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("- 1\n", "no table"),
        ("image: [", "cannot be read"),
        ("", "no table"),
        ("[" * 9000, "nested too deeply"),
        ("image: [a.pgm]", "its image is no name"),
    ],
)
def test_what_is_no_description_is_refused(tmp_path, text, cause):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(RunError, match=cause):
        load_picture(tmp_path / "a.yaml")
