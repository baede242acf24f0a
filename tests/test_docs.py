"""What the documents show is true: code runs, files exist, commands are there."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_the_block_in_the_overview_works():
    text = (ROOT / "docs" / "overview.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.S)[1]
    names = {"__name__": "shown"}
    exec(code, names)
    slow = names["Slow"](share=0.25)
    assert slow.react(1, names["Twist"](0, 0.4, 2.0)) == (1, 0.1, 0.5)


def test_links_resolve():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}, not there"


def test_files_named_in_the_overview_exist():
    text = (ROOT / "docs" / "overview.md").read_text()
    for name in re.findall(r"`((?:\w+/)+\w+\.py)`", text):
        inside = ROOT / "diffbotctl" / name
        assert inside.exists() or (ROOT / name).exists(), f"the overview names {name}: not there"


def test_commands_in_the_readme_run():
    from click.testing import CliRunner

    from diffbotctl.cli.main import COMMANDS, program

    text = (ROOT / "README.md").read_text()
    commands = re.findall(r"^    diffbotctl (.*?)(?:\s+#.*)?$", text, re.M)
    assert commands
    for line in commands:
        import shlex

        words = shlex.split(line)
        assert words[0] in COMMANDS
        if "--port" in words or words[0] == "emulate":
            continue  # tests/runs and tests/links run these, on boards behind pseudo-terminals
        if words[0] == "run" and "--fast" not in words:
            words += ["--fast"]
        if words[0] == "run":
            words += ["--quiet"]
        result = CliRunner().invoke(program, words, standalone_mode=False)
        assert result.exception is None, f"diffbotctl {line}: {result.exception!r}"


def test_the_reference_is_what_the_declarations_say():
    from diffbotctl.config import reference

    assert reference.PAGE.read_text() == reference.page(), (
        "docs/reference.md is out of date: run `python -m diffbotctl.config.reference`"
    )
