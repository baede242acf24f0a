"""The page in a real browser, on a computer and on an emulated phone."""

import json
import signal
import struct
import time
import zlib
from math import pi

import pytest
from PIL import Image, ImageChops

from diffbotctl.learn.course import find_lesson
from diffbotctl.learn.learner_folder import LearnerFolder
from diffbotctl.time import SECOND
from diffbotctl.web.server import load_assets
from tests.sampling import by_day, each_once
from tests.support.browser import (
    DESKTOP,
    PHONE,
    POLL_PERIOD_S,
    REPLY_TIMEOUT_S,
    Browser,
)
from tests.support.page_server import serving
from tests.support.running import PlainClient, moves, running, stands
from tests.support.trials.page_losses import LOSSES, lose_once, station

FIRST_MAX_BYTES = 60 << 10  # gzipped, before the view in three dimensions is opened
TOTAL_MAX_BYTES = 240 << 10
SOLID_FILES = {"robot_view.js", "urdf_model.js", "solid_shapes.js", "matrix4.js", "robot.urdf"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def parts(folder):
    with station(folder) as parts:
        yield parts


@pytest.fixture(scope="module")
def browser(folder):
    with Browser(folder / "profile") as browser:
        yield browser


@pytest.fixture
def open_page(browser, parts):
    """A function that opens the page on a device of its own; `is_phone` or not."""
    server, client, _ = parts
    opened = []

    def open_on(is_phone):
        context = browser.command("Target.createBrowserContext")["browserContextId"]
        page = browser.open_page(context=context)
        opened.append(page)
        if is_phone:
            page.emulate_phone()
        else:
            page.resize(DESKTOP)
        page.open(server.next_link())
        page.until("document.getElementById('role').textContent.includes('in control')")
        page.until("document.getElementById('facts').textContent.includes('pose')")
        return page

    yield open_on
    for page in opened:
        browser.command("Target.closeTarget", targetId=page.target)
    # On a busy computer the server notices later that a page is closed which was driving; the
    # engine stops the robot by itself within half a second.
    closed_at = client.request("status")["time"]
    client.until(lambda status: status["time"] > closed_at + SECOND and stands(status))
    client.request("resume")


def press(page, selector):
    """Press a button with what the device has."""
    if page.evaluate("navigator.maxTouchPoints > 0"):
        page.tap(selector)
    else:
        page.click(selector)


def pixels(path):
    """Width, height and the different colours of a PNG file."""
    data = path.read_bytes()
    width, height = struct.unpack(">II", data[16:24])
    parts, at = b"", 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        if data[at + 4 : at + 8] == b"IDAT":
            parts += data[at + 8 : at + 8 + length]
        at += length + 12
    return width, height, len(zlib.decompress(parts))


@pytest.mark.nightly
def test_the_page_is_small():
    sizes = {path[1:]: len(asset.data) for path, asset in load_assets().items() if path != "/"}
    first = sum(size for name, size in sizes.items() if name not in SOLID_FILES)
    assert first < FIRST_MAX_BYTES and sum(sizes.values()) < TOTAL_MAX_BYTES


@each_once(is_phone=[False, True], is_dark=[False, True])
def test_nothing_is_cut_and_nothing_comes_from_elsewhere(open_page, parts, is_phone, is_dark):
    page = open_page(is_phone)
    page.prefer_dark(is_dark)
    width, height = PHONE if is_phone else DESKTOP
    for view in ("drive", "map", "inside"):
        press(page, f"#view-{view}")
        page.until(f"document.body.dataset.view === '{view}'")
        shown = page.evaluate(
            "[...document.querySelectorAll('button, #pad, #facts, #limit-input')]"
            ".filter(e => e.checkVisibility() && e.getBoundingClientRect().width)"
            ".map(e => [e.id, ...Object.values(e.getBoundingClientRect().toJSON())])"
        )
        names = {name for name, *_ in shown}
        assert {"stop", "resume", "take"} <= names
        for name, x, y, w, h, *_ in shown:
            assert x >= 0 and y >= 0 and x + w <= width and y + h <= height, name
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    address = f"127.0.0.1:{parts[0].port}/"
    assert {each.partition("//")[2].partition("/")[0] + "/" for each in page.addresses()} == {
        address
    }


PHONE_WITH_BARS = (390, 664)  # CSS pixels; what an address bar and a tool bar leave of PHONE


@pytest.mark.nightly
def test_on_a_phone_the_bars_of_the_browser_cover_no_key(open_page):
    page = open_page(True)
    page.emulate_phone(PHONE_WITH_BARS)
    page.until(f"innerHeight === {PHONE_WITH_BARS[1]}")
    box = page.evaluate("document.getElementById('map-box').getBoundingClientRect().toJSON()")
    keys = page.evaluate(
        "[...document.querySelectorAll('#map-keys button')].filter(e => e.checkVisibility())"
        ".map(e => e.getBoundingClientRect().toJSON())"
    )
    assert keys and all(key["bottom"] <= box["bottom"] for key in keys)
    for name in ("stop", "resume", "pad"):
        place = page.evaluate(f"document.getElementById('{name}').getBoundingClientRect().toJSON()")
        assert place["top"] >= 0 and place["bottom"] <= PHONE_WITH_BARS[1], name


# CSS pixels: low phones in portrait and landscape format.
LOW_PHONES = [(320, 568), (360, 560), (568, 320), (667, 375), (844, 390)]


@pytest.mark.nightly
@pytest.mark.parametrize("size", LOW_PHONES)
def test_on_a_low_phone_everything_is_within_reach(open_page, size):
    page = open_page(True)
    page.emulate_phone(size)
    page.until(f"innerHeight === {size[1]}")
    for view, names in (
        ("drive", ("stop", "resume", "take", "pad", "limit-input", "velocity", "facts", "map")),
        ("map", ("stop", "resume", "take", "zoom-in", "zoom-out", "fit", "follow", "solid", "map")),
        ("inside", ("stop", "resume", "take")),
    ):
        press(page, f"#view-{view}")
        for name in names:
            place = page.evaluate(
                f"document.getElementById('{name}').getBoundingClientRect().toJSON()"
            )
            assert place["left"] >= 0 and place["right"] <= size[0], (view, name)
            assert place["top"] >= 0 and place["bottom"] <= size[1], (view, name)
            assert place["height"] >= (60 if name == "map" else 16), (view, name)


@pytest.mark.nightly
@pytest.mark.parametrize("size", LOW_PHONES[:1])
def test_a_tap_beside_the_robot_is_a_goal_beside_it_also_after_a_low_map(open_page, parts, size):
    """A map that is lower than its borders was shown at a scale below zero."""
    page, client = open_page(True), parts[1]
    page.emulate_phone(size)
    client.request("goto", x=0.2, y=-0.2)
    client.until(lambda status: status["operator.goal"]["y"] == -0.2)
    page.until("document.getElementById('facts').textContent.includes('-0.200')")
    press(page, "#view-map")
    page.until("document.body.dataset.view === 'map'")
    page.touch("touchStart", page.centre("#map"))
    page.touch("touchEnd")
    page.until("document.getElementById('allow').open")
    while page.evaluate("document.getElementById('allow').open"):
        press(page, "#allow-yes")
    status = client.until(lambda status: status["operator.goal"]["y"] != -0.2)
    pose = client.request("snapshot")["messages"]["odometry.odometry"]
    goal = status["operator.goal"]
    assert abs(goal["x"] - pose["x"]) < 2 and abs(goal["y"] - pose["y"]) < 2


def test_a_person_sees_what_the_engine_reports(open_page, parts):
    page, client = open_page(False), parts[1]
    press(page, "#stop")
    held = client.until(lambda status: status["held"])["held"]
    text = page.until("!document.getElementById('banner').hidden && banner.textContent")
    assert held["code"] == "operator_stop" and held["cause"].startswith("computer ")
    assert held["cause"] in text and "waits for `resume`" in text
    press(page, "#view-inside")
    page.until("document.getElementById('why').textContent.includes('operator_stop')")
    page.until("document.getElementById('blocks').textContent.includes('odometry')")
    page.until("document.getElementById('topics').textContent.includes('gate.wheels')")
    page.until("document.getElementById('parameters').textContent.includes('guard.margin')")
    page.until("document.getElementById('log').textContent.includes('operator_stop')")
    press(page, "#resume")
    client.until(lambda status: status["held"] is None)
    page.until("document.getElementById('banner').hidden")


def test_what_is_old_is_shown_as_old(tmp_path, browser):
    page = browser.open_page()
    with running(tmp_path, "standby", "--stay"), serving(tmp_path) as server:
        page.open(server.next_link())
        page.until("document.getElementById('facts').textContent.includes('pose')")
        page.until("document.body.dataset.connected === 'yes'")
        server.process.send_signal(signal.SIGSTOP)
        page.until("document.getElementById('notice').textContent.includes('is old')")
        assert float(page.evaluate("getComputedStyle(document.getElementById('map')).opacity")) < 1
        server.process.send_signal(signal.SIGCONT)
        page.until("document.body.dataset.connected === 'yes'")
        page.until("document.getElementById('notice').hidden")


def test_a_parameter_is_changed_with_its_unit(open_page, parts):
    page, client = open_page(False), parts[1]
    press(page, "#view-inside")
    field = "document.querySelector('[aria-label=\"guard.margin\"]')"
    page.until(f"{field} !== null")
    page.evaluate(f"void ({field}.focus(), {field}.value = '9 cm')")
    for kind in ("rawKeyDown", "keyUp"):
        page.command(
            "Input.dispatchKeyEvent", type=kind, key="Enter", code="Enter", windowsVirtualKeyCode=13
        )
    page.until(f"{field}.value === '0.09'")
    rows = client.request("list_parameters")["parameters"]
    assert {row["parameter"]: row["value"] for row in rows}["guard.margin"] == 0.09


CHOOSE = """(names => {
    const [topic, field] = ['plot-topic', 'plot-field'].map(id => document.getElementById(id));
    topic.value = names[0];
    topic.dispatchEvent(new Event('change'));
    field.value = names[1];
    return field.value === names[1] && !document.getElementById('plot-add').disabled;
})"""


@pytest.mark.nightly
@pytest.mark.parametrize("is_phone", [False, True])
def test_numbers_are_plotted_with_a_scale_for_each_unit(open_page, is_phone):
    page = open_page(is_phone)
    press(page, "#view-inside")
    page.until("document.querySelectorAll('#plots figure').length === 1")  # the wheels
    page.until(f"{CHOOSE}(['odometry.odometry', 'x'])")
    page.evaluate("document.getElementById('plot-add').scrollIntoView()")
    press(page, "#plot-add")
    page.until("document.querySelectorAll('#plots figure').length === 2")
    page.until(
        "/odometry.x.* m$/.test(document.querySelectorAll('#plots output')[2]"
        ".parentElement.textContent.replace('\u00d7', ''))"
    )
    page.until("/rad.s/.test(document.querySelector('#plots output').textContent)")
    dashes = "[...document.querySelectorAll('.sample line')].map(e => e.outerHTML)"
    assert len(set(page.evaluate(dashes))) == 3
    inside = "document.getElementById('inside')"
    assert page.evaluate(f"{inside}.scrollWidth <= {inside}.clientWidth")
    colours = (
        "(c => new Set(new Uint32Array(c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data.buffer)).size)"
        "(document.querySelector('#plots canvas'))"
    )
    page.until(f"{colours} > 4")  # ground, grid, frame, ink and lines
    press(page, "#view-drive")  # while they are not visible, no samples are sent
    wait_for_last_plot(page, [])


KEYS_WIDTH_PX = 84  # on the right of the map
LOSE_GRAPHICS_MEMORY = """new Promise(done => {
    const canvas = document.getElementById('robot-view');
    const loss = canvas.getContext('webgl').getExtension('WEBGL_lose_context');
    canvas.addEventListener('webglcontextlost', () => setTimeout(() => loss.restoreContext()));
    canvas.addEventListener('webglcontextrestored', () => done(true));
    loss.loseContext();
})"""
BODY_PIXELS_MIN = 2000  # of the blue body, on the screen of a phone


@pytest.mark.nightly
@pytest.mark.parametrize("is_phone", [False, True])
def test_the_robot_in_three_dimensions_is_loaded_when_it_is_asked_for(
    open_page, tmp_path, is_phone
):
    page = open_page(is_phone)

    def loaded():
        return SOLID_FILES & {address.rpartition("/")[2] for address in page.addresses()}

    press(page, "#view-map")
    assert not loaded()
    press(page, "#solid")
    page.until("document.getElementById('solid').getAttribute('aria-pressed') === 'true'")
    wait_until(lambda: loaded() == SOLID_FILES)
    wait_until(lambda: body_pixels(page, tmp_path / "solid.png") > BODY_PIXELS_MIN)
    page.evaluate(LOSE_GRAPHICS_MEMORY)
    wait_until(lambda: body_pixels(page, tmp_path / "solid.png") > BODY_PIXELS_MIN)
    press(page, "#solid")
    page.until("!document.getElementById('map').hidden")
    assert page.evaluate("document.getElementById('robot-view').hidden")


def body_pixels(page, path):
    """How many pixels beside the keys are blue as the body of the robot."""
    left, top, width, height, ratio = page.evaluate(
        "(r => [r.x, r.y, r.width, r.height, devicePixelRatio])"
        "(document.getElementById('robot-view').getBoundingClientRect())"
    )
    page.screenshot(path)
    box = (left, top, left + width - KEYS_WIDTH_PX, top + height)
    red, _, blue = Image.open(path).convert("RGB").crop([ratio * each for each in box]).split()
    return sum(ImageChops.subtract(blue, red).point(lambda value: value > 70).histogram()[1:])


# The way of a robot from the origin, and by how much its wheels turned, by hand, with the track
# and the radius r of both wheels: forward by 2 pi r is one turn of each; on the spot by pi the left
# wheel rolls back on a half circle of track / 2.
WAYS = [
    ("[[0, 0, 0], [2 * Math.PI * r, 0, 0]]", "[2 * Math.PI, 2 * Math.PI]"),
    ("[[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]]", "[-1.5 * track / r, 1.5 * track / r]"),
    ("[[0, 0, 3], [0, 0, -3]]", "[(3 - Math.PI) * track / r, (Math.PI - 3) * track / r]"),
    ("[[1, 2, Math.PI / 2], [1, 2 - r, Math.PI / 2]]", "[-1, -1]"),
]


@pytest.mark.nightly
@pytest.mark.parametrize("way, turned", WAYS)
def test_wheels_of_the_model_turn_by_the_way_that_they_went(open_page, way, turned):
    page = open_page(False)
    angles, expected, place, track, radius = page.evaluate(
        "Promise.all([import('/urdf_model.js'), fetch('/robot.urdf').then(r => r.text())])"
        ".then(([{ UrdfModel }, text]) => {"
        "  const model = new UrdfModel(text);"
        "  const [left, right] = model.joints.filter(joint => joint.isWheel);"
        "  const [r, track] = [left.radius, left.left - right.left];"
        f" for (const pose of {way}) model.moveTo(pose);"
        f" const angles = [left.angle, right.angle], expected = {turned};"
        "  model.moveTo([1, 2, Math.PI / 2]);"
        "  return [angles, expected, model.links().get(left.child).slice(12, 15), track, r];"
        "})"
    )
    assert angles == pytest.approx(expected)
    assert place == pytest.approx([1 - track / 2, 2, radius])  # the left wheel, robot facing y


def wait_until(seen):
    deadline = time.monotonic() + REPLY_TIMEOUT_S
    while not seen():
        assert time.monotonic() < deadline
        time.sleep(POLL_PERIOD_S)


def wait_for_last_plot(page, fields):
    """Wait until the newest choice of fields that the page has sent is `fields`."""

    def chosen():
        with page.browser.news:
            sent = [
                json.loads(event["params"]["response"]["payloadData"])
                for event in page.browser.events
                if event["method"] == "Network.webSocketFrameSent"
                and event["sessionId"] == page.session
            ]
        return [command["fields"] for command in sent if command["do"] == "plot"][-1]

    wait_until(lambda: chosen() == fields)


AXES = [  # from, to, about how many ticks, their labels
    (0, 1, 5, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
    (-0.26, 0.51, 4, ["-0.2", "0.0", "0.2", "0.4"]),
    (0, 0, 4, ["-0.5", "0.0", "0.5"]),  # a constant: half a unit around it
    (100, 100, 2, ["50", "100", "150"]),
    (17.2, 47.2, 3, ["20", "30", "40"]),
    (0, 3e7, 3, ["0", "1.00e+7", "2.00e+7", "3.00e+7"]),
    (0.0311, 0.0319, 2, ["0.0312", "0.0314", "0.0316", "0.0318"]),
]


@pytest.mark.nightly
def test_the_page_shows_how_it_is_installed(open_page):
    page = open_page(True)
    press(page, "#view-inside")
    page.evaluate("document.getElementById('install').scrollIntoView()")
    assert page.evaluate("document.getElementById('install').checkVisibility()")
    assert "certificate.pem" in page.evaluate("document.getElementById('install').innerText")
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
    manifest = page.evaluate("fetch('/page.webmanifest').then(reply => reply.json())")
    assert manifest["display"] == "standalone"


@pytest.mark.nightly
def test_axes_have_round_numbers(open_page):
    page = open_page(False)
    work = "([a, b, n]) => { const axis = m.makeAxis(a, b, n); return axis.ticks.map(axis.label); }"
    bounds = json.dumps([row[:3] for row in AXES])
    labels = page.evaluate(f"import('/plot_axis.js').then(m => {bounds}.map({work}))")
    assert labels == [row[3] for row in AXES]


def hold(client, press_down, lift, seen):
    """Press until `seen(status)`. A busy computer may lose the page: then it is pressed again."""
    while True:
        press_down()
        status = client.until(lambda status: seen(status) or status["held"])
        if not status["held"]:
            return
        assert status["held"]["code"] == "operator_lost"
        lift()
        client.until(stands)
        client.request("resume")


@pytest.mark.parametrize(
    "dx, dy, signs",
    by_day(1, [(-90, 0, (-1, 1)), (0, -90, (1, 1)), (0, 90, (-1, -1)), (90, 0, (1, -1))]),
)
def test_the_joystick_drives_and_a_release_stops_in_order(open_page, parts, dx, dy, signs):
    page, client = open_page(True), parts[1]
    x, y = page.centre("#pad")

    def press_down():
        page.touch("touchStart", (x, y))
        page.touch("touchMove", (x + dx, y + dy))

    def turns(status):
        wheels = status["gate.wheels"]
        return wheels["left"] * signs[0] > 0 and wheels["right"] * signs[1] > 0

    hold(client, press_down, lambda: page.touch("touchEnd"), turns)
    page.touch("touchEnd")
    client.until(stands)
    held = client.request("status")["held"]
    assert held is None or held["code"] == "operator_lost"  # on a busy computer


def test_arrow_keys_drive_while_they_are_held(open_page, parts):
    page, client = open_page(False), parts[1]

    def key(kind):
        page.command("Input.dispatchKeyEvent", type=kind, key="ArrowDown", code="ArrowDown")

    hold(
        client,
        lambda: key("rawKeyDown"),
        lambda: key("keyUp"),
        lambda status: moves(status) and status["gate.wheels"]["left"] < 0,
    )
    key("keyUp")
    client.until(stands)


def test_one_drives_and_others_watch(open_page, parts):
    client = parts[1]
    driver, watcher = open_page(True), open_page(False)
    driver.tap("#take")
    watcher.until("document.getElementById('role').textContent.includes('in control: phone')")
    watcher.command("Input.dispatchKeyEvent", type="rawKeyDown", key="ArrowUp", code="ArrowUp")
    watcher.until("document.getElementById('notice').textContent.includes('take over first')")
    watcher.click("#view-map")
    watcher.click("#map")
    watcher.until("document.getElementById('notice').textContent.includes('is in control')")
    assert stands(client.request("status"))
    watcher.click("#stop")  # anyone may
    assert client.until(lambda status: status["held"])["held"]["code"] == "operator_stop"
    driver.until("!document.getElementById('banner').hidden")
    driver.tap("#resume")
    client.until(lambda status: status["held"] is None)
    watcher.click("#take")
    watcher.until("document.getElementById('role').textContent.includes('this page')")
    driver.until("document.getElementById('role').textContent.includes('computer')")


@pytest.mark.parametrize("name", by_day(2, LOSSES))
def test_a_phone_that_is_lost_stops_the_robot(folder, parts, name):
    """How soon is measured by `make prove SECTION=phones`."""
    loss = LOSSES[name]
    result = lose_once(folder, parts, loss)
    assert loss.cause is None or ("phone" in result.cause and "was driving" in result.cause)


@pytest.mark.nightly
def test_a_tap_does_not_answer_the_question_that_it_opens(open_page, parts):
    page, client = open_page(True), parts[1]
    press(page, "#view-map")
    page.evaluate("document.getElementById('allow').show()")
    place = page.centre("#allow-yes")
    page.evaluate("document.getElementById('allow').close()")
    before = client.request("status")["operator.goal"]
    page.touch("touchStart", place)
    page.touch("touchEnd")
    page.until("document.getElementById('allow').open")
    page.touch("touchStart", place)  # a second one at once, of a person who expects the first to do
    page.touch("touchEnd")
    page.until("!document.getElementById('allow-yes').disabled")
    assert page.evaluate("document.getElementById('allow').open")
    assert client.request("status")["operator.goal"] == before
    while page.evaluate("document.getElementById('allow').open"):
        press(page, "#allow-yes")
    client.until(lambda status: status["operator.goal"] != before)


GOALS = [(is_phone, zoom, drag) for is_phone in (False, True) for zoom, drag in ((0, 1), (3, 0))]


@pytest.mark.parametrize("is_phone, zoom, has_heading", by_day(1, GOALS))
def test_a_goal_from_the_map_is_reached(open_page, parts, is_phone, zoom, has_heading):
    page, client = open_page(is_phone), parts[1]
    press(page, "#view-map")
    for _ in range(zoom):
        press(page, "#zoom-in" if is_phone else "#zoom-out")
    before = client.request("status")["operator.goal"]
    x, y = page.centre("#map")
    start, end = (x - 40, y - 30), (x - 40, y - 90)
    if is_phone:
        page.touch("touchStart", start)
        if has_heading:
            page.touch("touchMove", end)
        page.touch("touchEnd")
    else:
        page.mouse("mousePressed", start)
        if has_heading:
            page.mouse("mouseMoved", end)
        page.mouse("mouseReleased", end if has_heading else start)
    page.until("document.getElementById('allow').open")
    while page.evaluate("document.getElementById('allow').open"):
        press(page, "#allow-yes")  # browsers ignore a tap that follows a quick drag at once
    client.until(lambda status: status["operator.goal"] not in (None, before))
    goal = client.until(
        lambda status: (
            (state := status["goal_state"])
            and state["number"] == status["operator.goal"]["number"]
            and state["state"].startswith("reached")
        )
    )["operator.goal"]
    heading = pytest.approx(pi / 2, abs=0.02) if has_heading else None
    assert goal["heading"] == heading
    page.until("document.getElementById('facts').textContent.includes('reached')")


@pytest.mark.nightly
def test_a_reload_keeps_the_session_and_the_trail(open_page, parts):
    page = open_page(True)
    name = page.evaluate("document.getElementById('role').textContent.split(';')[0]")
    page.command("Page.reload")
    page.until(f"document.getElementById('role').textContent.startsWith({json.dumps(name)})")


@pytest.mark.nightly
def test_pictures_have_the_size_of_the_device(open_page, tmp_path):
    for is_phone, size in ((False, DESKTOP), (True, tuple(2 * each for each in PHONE))):
        page = open_page(is_phone)
        page.screenshot(tmp_path / "page.png")
        width, height, count = pixels(tmp_path / "page.png")
        assert (width, height) == size and count > 0


def test_run_web_serves_the_page_of_its_run(tmp_path, browser):
    with serving(tmp_path, run=("standby",)) as server:
        page = browser.open_page(server.next_link())
        page.until("document.getElementById('facts').textContent.includes('pose')")
        page.click("#stop")
        page.until("!document.getElementById('banner').hidden")
        server.process.terminate()
        page.until("document.getElementById('notice').textContent.includes('run has ended')")
        server.process.wait(timeout=60)


def test_the_page_ends_with_its_run(tmp_path, browser):
    with running(tmp_path, "standby", "--stay") as run, serving(tmp_path) as server:
        page = browser.open_page(server.next_link())
        page.until("document.getElementById('facts').textContent.includes('pose')")
        PlainClient(tmp_path)
        run.terminate()
        page.until("document.getElementById('notice').textContent.includes('run has ended')")
        page.until("document.getElementById('role').textContent === 'not connected'")
        assert server.process.wait(timeout=60) == 0
        page.click("#stop")
        page.until("document.getElementById('notice').textContent.includes('does not reach')")


def test_the_page_of_a_lesson_shows_its_text_beside_the_map(tmp_path, browser):
    lesson = find_lesson("turtle_square")
    path = LearnerFolder(tmp_path / "learn").begin(lesson) / "square.yaml"
    with serving(tmp_path, run=(str(path), "--allow-programs")) as server:
        page = browser.open_page(server.next_link())
        page.until("document.body.dataset.view === 'lesson'")
        assert page.evaluate("document.querySelector('#lesson h2').textContent") in lesson.text
        assert "--dash" in page.evaluate("document.querySelector('#lesson pre').textContent")
        for size, is_phone in (((1280, 800), False), (PHONE, True)):
            page.resize(size, is_phone)
            for shown in ("#map", "#lesson", "#stop"):
                box = page.evaluate(
                    f"(b => [b.width, b.height])(document.querySelector('{shown}')"
                    ".getBoundingClientRect())"
                )
                assert min(box) > 60, (shown, size, box)
        page.click("#view-map")
        page.until("document.getElementById('lesson').offsetHeight === 0")
