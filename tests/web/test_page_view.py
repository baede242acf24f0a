"""A saved view in a real browser: the page opens it, and saves what it shows as a file."""

import time

import pytest

from diffbotctl.client.request_check import RequestRefusalError
from diffbotctl.errors import Source
from diffbotctl.ui.saved_view import ViewSettings, parse_view, read_view, save_view
from diffbotctl.web.page_view import requested_view, view_record
from tests.support.browser import DESKTOP, POLL_PERIOD_S, REPLY_TIMEOUT_S, Browser
from tests.support.page_server import serving
from tests.support.running import running

SAVED = ViewSettings(
    "plots", ("odometry.odometry.x", "odometry.odometry.heading"), 60.0, (0.5, -0.25, 3.0), False
)
WHOLE = {"panel": "plots", "fields": "odometry.odometry.x,gate.wheels.left", "span": "60"}
PART = {**WHOLE, "x": "0.5", "y": "-1e-1", "width": "2", "follow": "true"}


@pytest.mark.parametrize(
    ("query", "view"),
    [
        (WHOLE, ViewSettings("plots", ("odometry.odometry.x", "gate.wheels.left"), 60.0)),
        (
            PART,
            ViewSettings(
                "plots",
                ("odometry.odometry.x", "gate.wheels.left"),
                60.0,
                (0.5, -0.1, 2.0),
                True,
            ),
        ),
        ({**WHOLE, "fields": ""}, ViewSettings("plots", (), 60.0)),
    ],
)
def test_the_file_is_what_the_page_describes(query, view):
    assert parse_view(Source("view.yaml", requested_view(query))) == view


@pytest.mark.parametrize(
    "changed",
    [
        {"panel": "drive"},
        {"fields": "a.b"},
        {"fields": "a.b.c]\nkind: robot"},
        {"fields": ",".join(["a.b.c"] * 9)},
        {"span": "nan"},
        {"span": "1e9"},
        {"span": "long"},
        {"width": "0"},
        {"width": "-2"},
        {"x": "inf"},
    ],
)
def test_a_description_that_is_no_view_is_refused(changed):
    with pytest.raises(RequestRefusalError) as refused:
        requested_view({**PART, **changed})
    assert refused.value.status == 400


def test_a_server_without_a_view_informs_the_page():
    assert view_record(None) == {}
    assert view_record(SAVED)["place"] == (0.5, -0.25, 3.0)


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """The folder of a running engine."""
    folder = tmp_path_factory.mktemp("view")
    with running(folder, "standby", "--stay"):
        yield folder


def test_the_page_opens_a_saved_view_and_saves_it_again(engine, tmp_path):
    save_view(tmp_path / "first.yaml", SAVED)
    words = ("--view", str(tmp_path / "first.yaml"))
    with serving(engine, *words) as server, Browser(tmp_path / "profile") as browser:
        browser.command(
            "Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path / "saved")
        )
        page = browser.open_page()
        page.resize(DESKTOP)
        page.open(server.next_link())
        page.until("document.body.dataset.view === 'inside'")
        page.until("document.querySelectorAll('#plots figure').length === 2")  # m and rad
        assert page.evaluate("document.getElementById('plot-span').value") == "60"
        page.evaluate("document.getElementById('save-view').scrollIntoView()")
        page.click("#save-view")
        saved = tmp_path / "saved" / "view.yaml"
        wait_for(saved)
        assert read_view(str(saved)) == SAVED
        # The map keeps the part that the file names: it is 3 m wide.
        page.click("#view-map")
        page.until("document.getElementById('map').clientWidth > 0")
        page.click("#zoom-in")
        page.click("#view-inside")
        saved.unlink()
        page.click("#save-view")
        wait_for(saved)
        x, y, width = read_view(str(saved)).place
        assert (x, y) == pytest.approx((0.5, -0.25), abs=0.002)
        assert width == pytest.approx(3.0 / 1.4, abs=0.002)  # a step of the zoom


def test_a_device_without_a_session_gets_no_view(engine):
    with serving(engine) as server:
        link = server.next_link()
        for path in ("/view.json", "/view.yaml?panel=map&span=30"):
            assert server.request("GET", path)[0] == 401
        headers = {"Cookie": server.enter(link)["Cookie"]}
        assert server.request("GET", "/view.json", **headers)[:2] == (200, "{}")
        status, text, reply = server.request("GET", "/view.yaml?panel=map&span=30", **headers)
        assert status == 200 and "attachment" in reply["Content-Disposition"]
        assert parse_view(Source("view.yaml", text)) == ViewSettings()


def wait_for(path):
    deadline = time.monotonic() + REPLY_TIMEOUT_S
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(POLL_PERIOD_S)
