"""Blocks of other packages: found by entry points; a name registered twice is an error."""

import sys

import pytest
from click.testing import CliRunner

from diffbotctl import messages
from diffbotctl.cli.topic import types
from diffbotctl.config import registry
from diffbotctl.config.load import check
from diffbotctl.config.registry import RegistryError
from diffbotctl.message_types import type_name

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
        ("whisper = broken:Text", MODULE, "is not derived from"),
        ("whisper = broken:Whisper", "Whisper = 5", "is not derived from"),
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


def test_every_class_of_message_has_a_name_that_a_file_may_use():
    """`topic list` shows these names."""
    kinds = [
        kind
        for kind in vars(messages).values()
        if isinstance(kind, type) and getattr(kind, "_fields", ())[:1] == ("time",)
    ]
    kinds.remove(messages.Scalar)
    assert len(kinds) > 30
    for kind in kinds:
        assert registry.message_type(type_name(kind)) is kind
    assert sorted(map(type_name, kinds)) == registry.message_names()


def test_the_types_of_std_msgs_have_their_names_of_ros():
    assert registry.message_type("Int32") is messages.Int32
    assert registry.message_type("std_msgs/Int32") is messages.Int32
    assert registry.message_type("std_msgs/String") is registry.message_type("String")
    assert registry.message_type("String") is messages.Text
    assert messages.fields(messages.Int16)["data"][1].minimum == -32768
    assert messages.fields(messages.UInt8)["data"][1].maximum == 255


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Twyst", "did you mean Twist?"),
        ("geometry_msgs/Twist", "did you mean Twist?"),
        ("int32", "did you mean Int32?"),
        ("std_msgs/Strin", "did you mean String?"),
        ("std_msgs/Twist", "did you mean Twist?"),
        ("Smell", "`diffbotctl types` lists them: Battery, Bool, "),
        ("nose/Smell", "`diffbotctl types` lists them: Battery, Bool, "),
    ],
)
def test_an_unknown_type_lists_what_there_is(name, words):
    with pytest.raises(RegistryError) as caught:
        registry.message_type(name)
    assert words in caught.value.fix


def test_types_are_shown_without_an_engine():
    listed = CliRunner().invoke(types, []).output
    assert "\nTwist            Desired velocity of base_link.\n" in listed
    shown = CliRunner().invoke(types, ["std_msgs/Int8"]).output.splitlines()
    assert shown[0].startswith("Int8  ") and shown[2] == "  data -        The number. -128 to 127."
    shown = CliRunner().invoke(types, ["Twist"]).output
    assert "\n  angular rad/s    Turn rate.\n" in shown
