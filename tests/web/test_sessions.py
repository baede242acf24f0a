"""Codes that work once, Host and Origin, the kinds of devices, the certificate."""

import stat
from datetime import UTC, datetime, timedelta
from itertools import count

import pytest

from diffbotctl.client.request_check import RequestRefusalError, ServerOrigin, check_origin
from diffbotctl.web.certificate import load_certificate
from diffbotctl.web.sessions import SESSIONS_MAX, Sessions, device_kind


def sessions():
    numbers = count()
    return Sessions(lambda: f"key{next(numbers)}")


def test_a_code_works_once():
    known = sessions()
    code = known.code
    first = known.enter(code, "")
    assert first is not None and known.find(first.key) is first
    assert known.enter(code, "") is None
    assert known.code != code and known.enter(known.code, "") is not None


@pytest.mark.parametrize("code", ["", "key1", "KEY0", "key0 ", "kéy0"])
def test_a_wrong_code_gives_no_session(code):
    known = sessions()
    assert known.enter(code, "") is None
    assert known.code == "key0" and not known.by_key


def test_codes_are_long_and_differ():
    codes = {Sessions().code for _ in range(100)}
    assert len(codes) == 100 and all(len(code) >= 22 for code in codes)  # 128 bits


def test_devices_are_named_by_kind_and_number():
    known = sessions()
    names = [known.enter(known.code, agent).name for agent in ("iPhone", "X11; Linux", "iPad")]
    assert names == ["phone 1", "computer 2", "tablet 3"]


@pytest.mark.parametrize(
    "agent, kind",
    [
        ("Mozilla/5.0 (Linux; Android 14; Pixel 8) Chrome/130 Mobile Safari/537.36", "phone"),
        ("Mozilla/5.0 (Linux; Android 14; SM-X200) Chrome/130 Safari/537.36", "tablet"),
        ("Mozilla/5.0 (iPhone; CPU iPhone OS 17_0) Mobile/15E148 Safari/604.1", "phone"),
        ("Mozilla/5.0 (X11; Linux x86_64) Chrome/130.0.0.0 Safari/537.36", "computer"),
        ("\x1b[31m" * 100, "computer"),
    ],
)
def test_kinds_of_devices(agent, kind):
    assert device_kind(agent) == kind


def test_a_session_without_a_page_makes_room_for_a_new_one():
    known = sessions()
    devices = [known.enter(known.code, "") for _ in range(SESSIONS_MAX)]
    for device in devices[1:]:
        device.sockets = 1
    assert known.enter(known.code, "") is not None
    assert known.find(devices[0].key) is None and known.find(devices[1].key) is devices[1]


def test_with_all_sessions_in_use_no_one_enters():
    known = sessions()
    for _ in range(SESSIONS_MAX):
        known.enter(known.code, "").sockets = 1
    code = known.code
    assert known.is_full and known.enter(code, "") is None and known.code == code


ORIGIN = ServerOrigin("https", 8642, {"localhost", "robot", "robot.local"})
HERE = {"Host": "192.168.1.5:8642"}
OWN = "https://192.168.1.5:8642"
REQUESTS = [  # method, headers, status of the refusal
    ("GET", HERE, None),
    ("GET", {"Host": "robot.local:8642"}, None),
    ("GET", {"Host": "ROBOT:8642"}, None),
    ("GET", {}, 421),
    ("GET", {"Host": "evil.example:8642"}, 421),  # a name that was made to resolve to the robot
    ("GET", {"Host": "192.168.1.5"}, 421),
    ("GET", {"Host": "192.168.1.5:80"}, 421),
    ("GET", {"Host": "192.168.1.6:8642"}, 421),
    ("GET", {**HERE, "Origin": "https://evil.example"}, 403),
    ("GET", {**HERE, "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, 403),
    ("GET", {**HERE, "Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "cors"}, 403),
    ("GET", {**HERE, "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}, None),
    ("GET", {**HERE, "Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "no-cors"}, None),
    ("POST", HERE, 403),
    ("POST", {**HERE, "Origin": OWN}, None),
    ("POST", {**HERE, "Origin": "http://192.168.1.5:8642"}, 403),
    ("POST", {**HERE, "Origin": "https://robot.local:8642"}, 403),
    ("POST", {**HERE, "Origin": "null"}, 403),
    ("GET", {**HERE, "Upgrade": "websocket"}, 403),
    ("GET", {**HERE, "Upgrade": "websocket", "Origin": "https://evil.example"}, 403),
    ("GET", {**HERE, "Upgrade": "websocket", "Origin": OWN + ".evil.example"}, 403),
    ("GET", {**HERE, "Upgrade": "websocket", "Origin": OWN}, None),
]


@pytest.mark.parametrize("method, headers, status", REQUESTS)
def test_host_and_origin(method, headers, status):
    if status is None:
        check_origin(ORIGIN, "192.168.1.5", method, headers)
        return
    with pytest.raises(RequestRefusalError) as refusal:
        check_origin(ORIGIN, "192.168.1.5", method, headers)
    assert refusal.value.status == status


NOW = datetime(2030, 1, 1, tzinfo=UTC)


def test_the_certificate_is_made_once_and_private(tmp_path):
    folder = tmp_path / "web"
    first = load_certificate(folder, ["192.168.1.5"], NOW)
    again = load_certificate(folder, ["192.168.1.6"], NOW + timedelta(days=700))
    assert first.fingerprint == again.fingerprint and len(first.fingerprint) == 95
    assert stat.S_IMODE((folder / "certificate.pem").stat().st_mode) == 0o600


def test_a_certificate_of_a_wrong_clock_is_made_again(tmp_path):
    """A phone would refuse one that begins in the future."""
    ahead = load_certificate(tmp_path, [], NOW + timedelta(days=3000))
    corrected = load_certificate(tmp_path, [], NOW)
    assert corrected.fingerprint != ahead.fingerprint
    assert load_certificate(tmp_path, [], NOW).fingerprint == corrected.fingerprint


def test_a_certificate_near_its_end_is_replaced(tmp_path):
    first = load_certificate(tmp_path, [], NOW)
    assert load_certificate(tmp_path, [], NOW + timedelta(days=790)).fingerprint != (
        first.fingerprint
    )


@pytest.mark.parametrize("damage", ["others may read it", "not a certificate", "empty"])
def test_a_certificate_that_cannot_be_trusted_is_replaced(tmp_path, damage):
    first = load_certificate(tmp_path, [], NOW)
    file = tmp_path / "certificate.pem"
    if damage == "others may read it":
        file.chmod(0o644)
    else:
        file.write_text("" if damage == "empty" else "certificate")
    assert load_certificate(tmp_path, [], NOW).fingerprint != first.fingerprint
