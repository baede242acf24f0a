"""A zip file for a helper: facts of the machine, its ports, and the last run."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import zipfile
from collections.abc import Iterable, Iterator
from importlib.metadata import distributions
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from diffbotctl import __version__
from diffbotctl.diagnostics.bundle_recording import share_recording
from diffbotctl.diagnostics.doctor import DoctorFinding
from diffbotctl.diagnostics.private_text import PrivateText
from diffbotctl.errors import Problem, RunError
from diffbotctl.ports.diagnosis import PortSurvey
from diffbotctl.ports.sysfs import read_text
from diffbotctl.recording.run_end import newest_flight

FOLDER = "diffbotctl_bundle/"  # in the zip file; its name at the beginning is our mark
FILE_MAX_BYTES = 1 << 20  # of a text that is added; robot and pipeline files have some kB
RECORDING = ".mcap"
MEMORY = re.compile(r"MemTotal:\s+(\d+) kB")


class BundleEntry(NamedTuple):
    """One file of the bundle: its name, its content, and a few words about it."""

    name: str
    data: bytes
    words: str


def collect(
    root: Path,
    findings: Iterable[DoctorFinding],
    survey: PortSurvey,
    added: Iterable[Path],
    private: PrivateText,
) -> list[BundleEntry]:
    """Everything that the bundle contains, without what is private.

    `added` are files that the user names. Raises RunError when one of them cannot be read.
    """
    entries = [
        _text_entry("doctor.txt", _findings_text(findings), "the findings of `doctor`", private),
        _json_entry("system.json", _system(root), "system, memory, processor", private),
        _json_entry("packages.json", _packages(), "versions of Python packages", private),
        _json_entry("ports.json", _ports(survey), "serial ports and their chips", private),
    ]
    flight = newest_flight()
    if flight is not None:
        entries += _flight_entries(flight, private)
    for path in added:
        entries += _added_entries(path, private)
    return list(_with_distinct_names(entries))


def _flight_entries(path: Path, private: PrivateText) -> Iterator[BundleEntry]:
    """The flight and its files, or why they are missing: the rest of the bundle helps too."""
    try:
        yield from _recording_entries(path, "flight", "the last flight recording", private)
    except RunError as error:
        words = "why the last flight recording is missing"
        yield _text_entry("flight.txt", f"{error}\n", words, private)


def pack(entries: Iterable[BundleEntry]) -> bytes:
    output = BytesIO()
    with zipfile.ZipFile(output, "w", zipfile.ZIP_DEFLATED) as file:
        for entry in entries:
            file.writestr(FOLDER + entry.name, entry.data)
    return output.getvalue()


def _with_distinct_names(entries: Iterable[BundleEntry]) -> Iterator[BundleEntry]:
    """The entries; later ones of the same name get a number. Files with one content come once."""
    known: dict[str, bytes] = {}
    for entry in entries:
        path = PurePosixPath(entry.name)
        name, number = entry.name, 1
        while name in known and known[name] != entry.data:
            number += 1
            name = str(path.with_stem(f"{path.stem}_{number}"))
        if name not in known:
            known[name] = entry.data
            yield entry._replace(name=name)


def _text_entry(name: str, text: str, words: str, private: PrivateText) -> BundleEntry:
    return BundleEntry(private.without(name), private.without(text).encode(), words)


def _json_entry(name: str, value: Any, words: str, private: PrivateText) -> BundleEntry:
    text = json.dumps(private.without_in_json(value), indent=2) + "\n"
    return BundleEntry(name, text.encode(), words)


def _findings_text(findings: Iterable[DoctorFinding]) -> str:
    lines = (
        f"{each.verdict}  {each.topic}: {each.text}" + (f"\n    -> {each.fix}" if each.fix else "")
        for each in findings
    )
    return "\n".join(lines) + "\n"


def _system(root: Path) -> dict[str, Any]:
    release = read_text(root / "etc/os-release")
    name = re.search(r'^PRETTY_NAME="?([^"\n]*)', release, re.MULTILINE)
    memory = MEMORY.search(read_text(root / "proc/meminfo"))
    disk = shutil.disk_usage(Path.home().anchor)
    return {
        "diffbotctl": __version__,
        "python": platform.python_version(),
        "system": "" if name is None else name[1],
        "kernel": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "computer": read_text(root / "proc/device-tree/model").strip("\0\n"),
        "processors": os.cpu_count(),
        "memory_bytes": None if memory is None else int(memory[1]) * 1024,
        "disk_free_bytes": disk.free,
    }


def _packages() -> list[str]:
    """Name and version, with a word before numbers that could be taken for an address."""
    packages = {each.metadata["Name"]: each.version for each in distributions()}
    return sorted(f"{name} v{version}" for name, version in packages.items() if name)


def _ports(survey: PortSurvey) -> dict[str, Any]:
    """Names under /dev/serial/by-id contain serial numbers, and are left out."""
    return {
        "ports": [
            {
                "device": report.port.device,
                "title": report.title,
                "usb": None if report.port.usb is None else report.port.usb.identity,
                "place": None if report.port.usb is None else report.port.usb.place,
                "is_bluetooth": bool(report.port.address),
                "usable": report.usable,
                "problems": [_problem(problem) for problem in report.problems],
            }
            for report in survey.reports
        ],
        "problems": [_problem(problem) for problem in survey.problems],
    }


def _problem(problem: Problem) -> dict[str, str]:
    return {"code": problem.code, "cause": f"{problem.place}: {problem.cause}"}


def _recording_entries(
    path: Path, name: str, words: str, private: PrivateText
) -> Iterator[BundleEntry]:
    recording = share_recording(path, private)
    about = "; ".join((words, *recording.notes))
    yield BundleEntry(private.without(f"{name}{RECORDING}"), recording.data, about)
    for file, text in recording.files.items():
        short = f"{private.without(name)}_files/{PurePosixPath(file).name}"
        yield _text_entry(short, text, f"a file of {words}", private)


def _added_entries(path: Path, private: PrivateText) -> Iterator[BundleEntry]:
    if path.suffix == RECORDING:
        yield from _recording_entries(path, path.stem, "a recording that you named", private)
        return
    try:
        if path.stat().st_size > FILE_MAX_BYTES:
            raise RunError(
                Problem("E-FILE-SIZE", str(path), f"it has more than {FILE_MAX_BYTES} bytes")
            )
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise RunError(Problem("E-FILE-READ", str(path), f"{error.strerror}")) from error
    except UnicodeDecodeError as error:
        raise RunError(Problem("E-FILE-ENCODING", str(path), "it is no UTF-8 text")) from error
    yield _text_entry(f"added/{path.name}", text, "a file that you named", private)
