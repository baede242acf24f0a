"""Blocks of other packages: found by entry points; a name registered twice is an error."""

import sys

import pytest

from diffbotctl.config import registry
from diffbotctl.config.load import check
from diffbotctl.config.registry import RegistryError

MODULE = '''
from diffbotctl.block import Block, In
from diffbotctl.messages import Text

class Whisper(Block):
    """Receive a text and keep it."""
    text = In(Text)
    def react(self, now, text):
        return None
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Returns a function that installs a package with entry points."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(name, entries, module=MODULE):
        (tmp_path / f"{name}.py").write_text(module)
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(entries)
        sys.modules.pop(name, None)

    return install


def test_a_block_of_another_package_is_found(package):
    package("soft", "[diffbotctl.blocks]\nwhisper = soft:Whisper\n")
    assert registry.block("whisper").__name__ == "Whisper"
    assert "whisper" in registry.names()
    assert not registry.clashes()


def test_two_packages_with_one_name_clash(package):
    package("soft", "[diffbotctl.blocks]\nwhisper = soft:Whisper\n")
    package("quiet", "[diffbotctl.blocks]\nwhisper = quiet:Whisper\n")
    with pytest.raises(RegistryError) as caught:
        registry.block("whisper")
    assert caught.value.code == "E-BLOCK-CLASH"
    assert "soft" in str(caught.value)
    assert "quiet" in str(caught.value)


def test_a_package_with_a_built_in_name_clashes(package):
    package("loud", "[diffbotctl.blocks]\ntalker = loud:Whisper\n")
    assert [clash.code for clash in registry.clashes()] == ["E-BLOCK-CLASH"]
    # The name keeps its built-in class.
    assert registry.block("talker").__module__ == "diffbotctl.blocks.talker"


@pytest.mark.parametrize(
    "entry, module, words",
    [
        ("whisper = broken:Whisper", "import nothing_like_this", "ModuleNotFoundError"),
        ("whisper = broken:Whisper", "raise ValueError('half done')", "half done"),
        ("whisper = broken:Shout", MODULE, "AttributeError"),
        ("whisper = broken:Text", MODULE, "is not a block"),
        ("whisper = broken:Whisper", "Whisper = 5", "is not a block"),
    ],
)
def test_a_block_that_cannot_be_loaded_is_reported(package, tmp_path, entry, module, words):
    package("broken", f"[diffbotctl.blocks]\n{entry}\n", module)
    file = tmp_path / "p.yaml"
    file.write_text("format: 1\nkind: pipeline\nblocks: {a: {block: whisper}}\n")
    problems = check(str(file))
    assert [problem.code for problem in problems] == ["E-BLOCK-IMPORT"]
    assert words in problems[0].cause
    assert problems[0].line == 3
