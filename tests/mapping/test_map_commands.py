"""`diffbotctl map` with a running engine: save, list, load, place, export, delete, and mistakes."""

import json
import time
from pathlib import Path

import pytest

from diffbotctl.control_socket.client import ControlClient, choose_engine
from diffbotctl.geometry.map_tiles import EMPTY_TILE, TILE, MapTiles, decode_tile, encode_tile
from diffbotctl.messages import MapUpdate
from tests.support.confined import run_command
from tests.support.running import LONGEST_WAIT, running


def program(*words, code=0):
    done = run_command(*words)
    assert done.code == code, done.complaints
    return done.output


@pytest.fixture
def engine(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    tmp_path.chmod(0o700)
    monkeypatch.chdir(tmp_path)
    with running(tmp_path, "map", "--stay", sets=[]):
        client = ControlClient(choose_engine(None, ""), "test")
        deadline = time.monotonic() + LONGEST_WAIT
        while client.request("read_map")["sha256"] == "":
            assert time.monotonic() < deadline
            time.sleep(0.1)
        yield client
        client.close()


def test_a_map_is_saved_loaded_exported_and_deleted(engine, tmp_path):
    assert "map saved: flat" in program("map", "save", "flat")
    program("map", "save", "flat", code=2)  # it would overwrite
    program("map", "save", "flat", "--force")
    names = [json.loads(line)["name"] for line in program("map", "list", "--json").splitlines()]
    assert "flat" in names
    before = engine.request("read_map")["map"]
    program("map", "load", "flat")
    assert engine.request("read_map")["map"] > before
    program("map", "place", "--x", "0", "--y", "-1cm", "--heading", "0")
    known = program("map", "place", "--x", "0", "--y", "0", code=1)
    assert "state the heading too" in known
    program("map", "export", "flat", "--to", "flat.yaml")
    assert (tmp_path / "flat.pgm").read_bytes().startswith(b"P5")
    assert "map imported: cells" in program("map", "import", "flat.yaml", "--name", "cells")
    assert "map loaded: cells" in program("map", "load", "cells")
    assert "there is a map of this name" in program("map", "import", "flat.yaml", code=2)
    assert "b.pgm" in program("map", "import", write_description("b"), code=1)
    half = tmp_path / "state" / "diffbotctl" / "maps" / "half.npz"
    half.write_bytes(half.with_name("flat.npz").read_bytes()[:900])
    assert "no whole map file" in program("map", "load", "half", code=1)
    assert "did you mean flat?" in program("map", "load", "flot", code=2)
    assert "letters, digits" in program("map", "save", "../flat", code=1)
    program("map", "delete", "flat", "--yes")
    assert "flat" not in program("map", "list")


def write_description(name):
    """The exported description, with the picture of another name, which does not exist."""
    text = Path("flat.yaml").read_text().replace("flat.pgm", f"{name}.pgm")
    Path(f"{name}.yaml").write_text(text)
    return f"{name}.yaml"


def test_tiles_read_back_as_they_were_written():
    cells = ("u" * 10 + "." * 30 + "#" * 24) * TILE
    assert decode_tile(encode_tile(cells)) == cells
    assert decode_tile(EMPTY_TILE) == "u" * TILE * TILE
    for wrong in ("", "12u", "9999999u", "4095u", "5000u", "60u3.1#", "x" * 100_000):
        with pytest.raises(ValueError, match="cells"):
            decode_tile(wrong)


def test_a_client_reads_only_what_has_changed():
    tiles, client = MapTiles(), {}
    number, is_last = 0, False
    for version in range(1, 41):
        places = [(version % 5, row) for row in range(7)]
        text = encode_tile(("#" * (version % 60 + 1)).ljust(TILE, ".") * TILE)
        flat = tuple(each for place in places for each in place)
        tiles.take(MapUpdate(0, "mapping", version=version, places=flat, tiles=(text,) * 7))
        if version % 3 == 0:
            continue
        is_last = False
        while not is_last:
            part, number = tiles.since(0, number)
            client |= {place: tiles.tiles[place] for place in part}
            is_last = number == tiles.number
        assert client == tiles.tiles
    assert tiles.since(0, number) == ([], number)
    assert len(tiles.since(5, number)[0]) == 35  # of another map: all
