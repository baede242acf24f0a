"""The commands about files: check, explain, blocks, graph."""

import subprocess
import sys

import pytest

from diffbotctl.cli import blocks, check, graph
from diffbotctl.codes import code_texts
from diffbotctl.config import registry
from diffbotctl.errors import UsageError
from tests.command_result import invoke


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


def test_check_finds_nothing_in_the_shipped_files():
    code, output = invoke(check.check, "goal", "square", "hello", "book_2wd", "book_2wd_counts")
    pulses = (
        "  the pulses for the motors are on in1 and in2: between them the driver brakes, which "
        "holds slow speeds"
    )
    assert code == 0
    left_out = "  left out: scan_guard (no sensor of the robot and no source gives a scan)"
    assert output.splitlines() == [
        "goal: no errors",
        left_out,
        "square: no errors",
        left_out,
        "hello: no errors",
        "book_2wd: no errors",
        pulses,
        "book_2wd_counts: no errors",
        pulses,
    ]


def test_check_takes_several_files_and_reports_on_all(tmp_path):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("format: 1\nkind: robot\ninclude: book_2wd\nlimits: {speed: 5 deg, sped: 1}\n")
    code, output = invoke(check.check, str(wrong), "goal", "--set", "follower.tolerance=1 mm")
    assert code == 2
    assert "E-UNIT" in output
    assert "E-KEY-UNKNOWN" in output
    assert "E-TOLERANCE" in output
    assert f"{wrong}: 2 errors" in output
    assert "goal: 1 error" in output


def test_warnings_do_not_fail_a_check():
    code, output = invoke(check.check, "goal", "--robot", "book_2wd_stock", "--real")
    assert code == 0
    assert "W-TOLERANCE" in output
    assert "W-POLARITY" in output
    assert "W-UNCALIBRATED" in output
    assert "goal: no errors, 3 warnings" in output


@pytest.mark.parametrize("name", ["nothing", "./nothing.yaml", "/", "..", "/dev/null"])
def test_check_of_what_is_not_there(name):
    code, output = invoke(check.check, name)
    assert code == 2
    assert "E-FILE" in output


@pytest.mark.parametrize("code", code_texts())
def test_every_code_is_explained(code):
    assert code_texts()[code].title in invoke(check.explain, code)[1]
    assert len(code_texts()[code].text) > 80, "a title alone is no explanation"
    assert invoke(check.explain, code.lower())[0] == 0


def test_explain_without_a_code_lists_all():
    _, output = invoke(check.explain)
    assert len(output.splitlines()) == len(code_texts())


def test_an_unknown_code():
    with pytest.raises(UsageError) as caught:
        invoke(check.explain, "E-PIN-PWN")
    assert caught.value.problems[0].fix == "did you mean E-PIN-PWM?"


def test_blocks_lists_every_block_with_its_sentence():
    code, output = invoke(blocks.blocks)
    assert code == 0
    lines = output.splitlines()
    names = [*registry.names(), *registry.driver_names()]
    assert [line.split()[0] for line in lines if line[0] != " "] == names
    assert max(map(len, lines)) <= 80
    assert all(len(line.split()) > 3 for line in lines if line[0] != " ")


@pytest.mark.parametrize("name", registry.BLOCKS)
def test_blocks_show(name):
    _, output = invoke(blocks.blocks, "show", name)
    assert output.startswith(f"{name}\n")
    assert "outputs" in output


def test_blocks_show_prints_all_that_is_declared():
    _, output = invoke(blocks.blocks, "show", "obstacle_stop")
    for words in (
        "range   Range (fresh for the parameter stale_after)",
        "twist  Twist  The safe velocity.",
        "margin       m, default 0.05 m, at least 0.01 m, at most 1 m, may change while\n"
        "      running.",
        "one of by_itself, wait",
        "limits.braking",
    ):
        assert words in output


def test_blocks_show_of_an_unknown_block():
    with pytest.raises(UsageError) as caught:
        invoke(blocks.blocks, "show", "odometri")
    assert caught.value.problems[0].fix == "did you mean odometry?"


def test_the_graph_of_the_smallest_pipeline():
    _, output = invoke(graph.graph, "hello")
    assert output.splitlines() == [
        "pipelines/hello.yaml",
        "talker",
        "└── text Text -> listener.text",
    ]


def test_the_graph_shows_what_the_builder_adds():
    _, output = invoke(graph.graph, "goal", "--robot", "book_2wd_stock")
    assert "wheels Wheels -> gate.command" in output
    assert "wheels Wheels -> wheel_speed.wheels" in output
    assert "duty Duty -> robot.duty" in output


def test_the_graph_as_mermaid():
    _, output = invoke(graph.graph, "hello", "--mermaid")
    assert output.splitlines() == [
        "flowchart LR",
        "    talker[talker]",
        "    listener[listener]",
        "    talker -->|text| listener",
    ]


def test_every_wire_of_a_pipeline_is_drawn_once():
    from diffbotctl.config.load import load
    from diffbotctl.runs.build_graph import assemble

    _, tree = invoke(graph.graph, "goal")
    _, mermaid = invoke(graph.graph, "goal", "--mermaid")
    nodes = assemble(load("goal"), False).graph.nodes
    wires = sum(len(node.wires) for node in nodes) + 1  # and the command that leaves
    assert tree.count(" -> ") == wires
    assert mermaid.count(" -->|") == wires


@pytest.mark.parametrize(
    "words, heavy",
    [
        (["--help"], {"yaml", "jsonschema", "rich", "numpy", "diffbotctl.config"}),
        (["explain", "E-UNIT"], {"jsonschema", "rich", "numpy"}),
        # yaml: defaults of a block's parameters are figures of data sheets
        (["blocks"], {"jsonschema", "rich", "numpy"}),
        (["check", "hello"], {"rich", "numpy"}),
    ],
)
def test_commands_import_no_more_than_they_need(words, heavy):
    script = (
        f"import sys; sys.argv = ['diffbotctl', *{words!r}]\n"
        "from diffbotctl.cli.main import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print('IMPORTED', *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    imported = set(done.stdout.split("IMPORTED")[1].split())
    assert not imported & heavy
