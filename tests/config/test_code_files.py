"""Blocks in files beside the pipeline: consent before anything is imported, and wrong files."""

import os
from pathlib import Path

import click
import pytest

from diffbotctl.block import Block
from diffbotctl.cli.blocks import show
from diffbotctl.cli.completion import settings
from diffbotctl.config import consents
from diffbotctl.config.code_files import CodeConsentError, CodeFiles
from diffbotctl.config.load import check, load
from diffbotctl.config.registry import RegistryError
from diffbotctl.errors import UsageError
from tests.command_result import invoke

HEAD = (
    "from diffbotctl.block import Block, In, Out\nfrom diffbotctl.messages import Odometry, Text\n"
)
NOSE = f"""
{HEAD}
from pathlib import Path
from diffbotctl.params import Param

Path(__file__).with_name("imported").touch()


class Nose(Block):
    every = Param(int, default=10, minimum=1, help="Messages between two texts.")
    odometry = In(Odometry)
    text = Out(Text)

    def reset(self):
        self.count = 0

    def react(self, now, odometry):
        self.count += 1
        return Text(now, str(self.count)) if self.count % self.every == 0 else None
"""
PIPELINE = """
format: 1
kind: pipeline
include: goal
blocks:
  nose: {block: ./nose.py:Nose, in: {odometry: odometry.odometry}, with: {every: 5}}
"""


@pytest.fixture
def pipeline(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(consents, "_allowed_here", set())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nose.py").write_text(NOSE)
    path = tmp_path / "nose.yaml"
    path.write_text(PIPELINE)
    return path


def allow(pipeline):
    """Consent to what the pipeline names, as a person does who is asked."""
    with pytest.raises(CodeConsentError) as refused:
        load(str(pipeline))
    for code in refused.value.files:
        consents.remember(code.consent_key)


def offered(pipeline):
    context = click.Context(click.Command("run"))
    context.params = {"pipeline": str(pipeline)}
    return [name for name in settings(context) if name.startswith("nose.")]


def test_nothing_imports_a_file_before_the_consent_and_again_after_a_change(pipeline):
    def is_refused():
        return [problem.code for problem in check(str(pipeline))] == ["E-CODE-CONSENT"]

    imported = pipeline.with_name("imported")
    assert is_refused() and offered(pipeline) == [] and not imported.exists()
    allow(pipeline)
    assert not imported.exists()
    assert check(str(pipeline)) == () and offered(pipeline) == ["nose.every="]
    assert imported.exists()
    (use,) = (use for use in load(str(pipeline)).blocks if use.name == "nose")
    assert use.values == {"every": 5} and use.cls.__name__ == "Nose"
    imported.unlink()
    pipeline.with_name("nose.py").write_text(NOSE + "# changed\n")
    assert is_refused() and not imported.exists()


def test_blocks_show_describes_a_block_in_a_file_once_it_is_allowed(pipeline):
    with pytest.raises(UsageError, match="E-CODE-CONSENT"):
        invoke(show, "./nose.py:Nose")
    allow(pipeline)
    _, printed = invoke(show, "./nose.py:Nose")
    assert "odometry  Odometry" in printed and "every  int, default 10, at least 1" in printed


def test_a_consent_is_to_the_content_wherever_it_is(pipeline, tmp_path):
    allow(pipeline)
    pipeline.with_name("nose.py").rename(tmp_path / "other.py")
    pipeline.with_name("nose.py").symlink_to(tmp_path / "other.py")
    assert check(str(pipeline)) == ()
    (tmp_path / "other.py").write_text(NOSE.replace("Text(", "Text (", 1))
    assert [problem.code for problem in check(str(pipeline))] == ["E-CODE-CONSENT"]


def test_other_errors_come_before_the_question(pipeline):
    pipeline.write_text(PIPELINE + "  stop: {block: obstacle_stopp}\n")
    with pytest.raises(Exception) as refused:
        load(str(pipeline))
    assert not isinstance(refused.value, CodeConsentError)


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (f"{HEAD}class Nose(Block)\n    pass\n", 3, "expected ':'"),
        (f"{HEAD}1 / 0\n", 3, "ZeroDivisionError"),
        ("import helper_of_mine\n", 1, "No module named"),
        ("import sys\nsys.exit(0)\n", 2, "SystemExit"),
        (f"{HEAD}class Nose(Block):\n    def __init__(self): self.n = 0\n", 3, "def reset(self)"),
        (
            f"{HEAD}class Nose(Block):\n    odometry = In(Odometry)\n",
            3,
            "must take (self, now, odo",
        ),
        (f"{HEAD}class Nase(Block): pass\n", 0, "did you mean Nase?"),
        ("class Nose: pass\n", 0, "not derived from Block"),
        (b"x = '\xe4'\n", 0, "UTF-8"),
        (b"x = 1\0\n", 0, "null bytes"),
        ("#" * ((1 << 20) + 1), 0, "more than 1 MB"),
    ],
)
def test_a_file_that_cannot_be_used_is_an_error_at_its_line(pipeline, text, line, said):
    file = pipeline.with_name("nose.py")
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    if line or "MB" not in said:
        allow(pipeline)
    (problem,) = check(str(pipeline))
    assert problem.code == "E-CODE-FILE" and said in f"{problem.cause} {problem.fix}"
    assert (problem.file, problem.line) == (("nose.py", line) if line else ("nose.yaml", 6))


def test_what_is_no_regular_file_is_not_opened(pipeline):
    file = pipeline.with_name("nose.py")
    file.unlink()
    for make in (os.mkfifo, Path.mkdir, lambda path: path.symlink_to("/dev/zero")):
        make(file)
        assert [problem.code for problem in check(str(pipeline))] == ["E-CODE-FILE"]
        file.rmdir() if file.is_dir() else file.unlink()
    for name in ("./nose.txt:Nose", "./nose.py", "./nose.py:", "a/b", "./nose.py:No se", ":Nose"):
        pipeline.write_text(PIPELINE.replace("./nose.py:Nose", f"'{name}'"))
        assert [problem.code for problem in check(str(pipeline))] == ["E-CODE-FILE"], name


def test_a_replay_finds_the_recorded_file_by_its_hash(pipeline, tmp_path):
    allow(pipeline)
    recorded = load(str(pipeline)).code
    assert list(recorded) == ["nose.yaml: ./nose.py"]
    here, beside = tmp_path / "here", tmp_path / "beside"
    here.mkdir()
    beside.mkdir()
    folders = (beside, here)
    (here / "renamed.py").write_text(NOSE)
    (beside / "nose.py").write_text(NOSE + "# changed\n")
    found = CodeFiles(recorded, folders).find("./nose.py:Nose", pipeline, Block)
    assert found.__name__ == "Nose"
    (here / "renamed.py").unlink()
    with pytest.raises(RegistryError, match="neither beside the recording nor"):
        CodeFiles(recorded, folders).find("./nose.py:Nose", pipeline, Block)
    code = {"nose.yaml: ./nose.py": recorded["nose.yaml: ./nose.py"], "nose.yaml: ./b.py": "0" * 64}
    for name in ("./b.py:Nose", "./c.py:Nose"):  # a hash of no file; no hash
        with pytest.raises(RegistryError):
            CodeFiles(code, folders).find(name, pipeline, Block)
