"""The robot's own map on the page: all of it in view, and the tap that says where the robot is."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.browser import Browser
from tests.support.page_server import serving

# A room that looks the same from both ends.
PIPELINE = """
format: 1
kind: pipeline
include: map
blocks:
  wander: {block: wander, in: {scan: robot.scan, odometry: odometry.odometry}}
  mux: {in: {autonomous: wander.twist}}
world:
  walls:
    - {from: [-1 m, -0.7 m], to: [1 m, -0.7 m]}
    - {from: [1 m, -0.7 m], to: [1 m, 0.7 m]}
    - {from: [1 m, 0.7 m], to: [-1 m, 0.7 m]}
    - {from: [-1 m, 0.7 m], to: [-1 m, -0.7 m]}
  obstacles: []
"""
FACTS = "document.getElementById('facts').textContent"
# Pixels of the colour of an occupied cell, at the canvas's left and right end of them.
WALLS = """(() => {
  const canvas = document.getElementById('map');
  const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const columns = new Set();
  for (let i = 0; i < data.length; i += 4)
    if (data[i] === 90 && data[i + 1] === 90 && data[i + 2] === 200) columns.add((i / 4) % width);
  return [Math.min(...columns) / width, Math.max(...columns) / width];
})()"""


# A robot that stands in a room with a pillar, and is put 0.4 m further on.
CARRIED = """
format: 1
kind: pipeline
include: map
world:
  walls:
    - {from: [-1.5 m, -1.2 m], to: [1.5 m, -1.2 m]}
    - {from: [1.5 m, -1.2 m], to: [1.5 m, 1.2 m]}
    - {from: [1.5 m, 1.2 m], to: [-1.5 m, 1.2 m]}
    - {from: [-1.5 m, 1.2 m], to: [-1.5 m, -1.2 m]}
  obstacles: [{at: [1.2 m, 0.9 m], radius: 20 cm}]
"""
MOVED = "robot.simulation.faults=[{fault: robot_moved, at: 6 s, size: 0.4 m}]"


@pytest.fixture
def page(request, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    path = tmp_path / "room.yaml"
    path.write_text(request.param)
    words = (str(path), "--set", "map.autosave=false")
    if request.param == PIPELINE:
        Run(load(str(path)), RunOptions(fast=True, duration=12.0, seed=4)).go()
        words += ("--set", "map.load=autosave")
    else:
        words += ("--set", MOVED)
    with serving(tmp_path, run=words) as server, Browser(tmp_path / "profile") as browser:
        page = browser.open_page()
        page.emulate_phone()
        page.open(server.next_link())
        yield page


@pytest.mark.parametrize("page", [CARRIED], indirect=True)
def test_where_the_robot_is_lost_a_tap_says_where_it_is(page):
    page.until(f"{FACTS}.includes('lost')")
    page.until("document.getElementById('place-hint').checkVisibility()")
    page.tap("#view-map")
    page.until("document.body.dataset.view === 'map'")
    page.tap("#map")
    page.until(f"{FACTS}.includes('mapping')")
    assert not page.evaluate("document.getElementById('place-hint').checkVisibility()")


@pytest.mark.parametrize("page", [PIPELINE], indirect=True)
def test_where_places_look_alike_a_tap_says_which(page):
    page.until(f"{FACTS}.includes('look alike')")
    page.until("document.getElementById('place-hint').checkVisibility()")
    page.tap("#view-map")
    page.until("document.body.dataset.view === 'map'")
    left, right = page.until(f"(ends => ends[0] < 0.2 && ends[1] > 0.6 && ends)({WALLS})")
    assert left > 0 and right < 0.9, "all of the room is in view"
    page.tap("#map")
    page.until(f"{FACTS}.includes('localised')")
    assert not page.evaluate("document.getElementById('place-hint').checkVisibility()")
