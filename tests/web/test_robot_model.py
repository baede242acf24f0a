"""The robot's URDF, for the view in three dimensions: who gets it, and what fails in words."""

from pathlib import Path
from xml.etree.ElementTree import fromstring

from diffbotctl.config.load import load_robot
from diffbotctl.model.urdf import urdf
from tests.support.page_server import serving
from tests.support.running import running


def test_the_urdf_is_that_of_the_run_and_needs_a_session(tmp_path):
    file = tmp_path / "rover.yaml"
    file.write_text(Path("robots/book_2wd.yaml").read_text())
    with (
        running(tmp_path, "standby", "--stay", "--robot", str(file)),
        serving(tmp_path) as server,
    ):
        link = server.next_link()
        status, text, _ = server.request("GET", "/robot.urdf")
        assert status == 401 and "open the link or scan the code" in text
        session = {"Cookie": server.enter(link)["Cookie"]}
        status, text, headers = server.request("GET", "/robot.urdf", **session)
        assert status == 200 and headers["Content-Type"].startswith("application/xml")
        assert text == urdf(load_robot(str(file)).robot, "rover")
        assert fromstring(text).get("name") == "rover"
        file.unlink()
        status, text, _ = server.request("GET", "/robot.urdf", **session)
        assert status == 404 and "robot file cannot be read here" in text and "rover.yaml" in text
