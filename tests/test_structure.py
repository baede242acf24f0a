"""Rules of the code's structure. A failure states the reason and the fix."""

import ast
import configparser
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# A folder or top-level module imports from its own layer and those above it, never from below.
LAYERS = {
    "declarations": [
        "time",
        "errors",
        "file_replacement",
        "codes",
        "messages",
        "message_types",
        "message_parser",
        "log",
        "units",
        "params",
        "block",
        "device",
        "physics_model",
        "printable",
        "user_folders",
        "parts",
    ],
    "algorithms and codecs": [
        "geometry",
        "control",
        "estimation",
        "mapping",
        "blocks",
        "links",
        "graph",
    ],
    "configuration": ["config"],
    "engine, plant, recording": ["engine", "processes", "plant", "model", "recording"],
    "devices and socket": [
        "ports",
        "bluetooth",
        "drivers",
        "emulator",
        "render",
        "control_socket",
        "programs",
        "prompts",
    ],
    "runs": ["runs"],
    "jobs": ["client", "replay", "flash", "calibrate", "diagnostics", "learn", "ros2", "trials"],
    "screens and command line": [
        "ui",
        "web",
        "foxglove",
        "cli",
        "__init__",
        "__main__",
    ],
}
LAYER = {name: number for number, names in enumerate(LAYERS.values()) for name in names}
IMPURE = {"time", "random", "os", "socket", "threading", "pathlib", "io", "datetime", "secrets"}
SOURCES = sorted((ROOT / "diffbotctl").rglob("*.py"))
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)

BUDGETS = {  # lines of Python at most, by folder; `.`: the modules beside the folders
    ".": 3_313,
    "blocks": 3_050,
    "bluetooth": 790,
    "calibrate": 8_090,
    "cli": 9_283,
    "client": 920,
    "config": 8_530,
    "control": 1_540,
    "control_socket": 3_630,
    "diagnostics": 600,
    "drivers": 3_640,
    "emulator": 1_110,
    "engine": 2_380,
    "estimation": 5_280,
    "flash": 1_450,
    "foxglove": 1_020,
    "geometry": 720,
    "learn": 695,
    "links": 4_240,
    "mapping": 2_255,
    "model": 240,
    "parts": 30,
    "plant": 4_130,
    "ports": 800,
    "processes": 610,
    "programs": 760,
    "prompts": 520,
    "recording": 3_920,
    "render": 1_850,
    "replay": 720,
    "ros2": 1_910,
    "runs": 1_290,
    "trials": 1_600,
    "ui": 4_330,
    "web": 1_550,
}

SMALL_MODULE_LINES = 25
SMALL_MODULES = {  # module: why it stands alone
    "__main__": "python -m diffbotctl",
    "time": "the lowest layer; every other module may import it",
    "blocks/listener": "a built-in block is the class in the module of its name",
}
VAGUE_CONSTANTS = {"MOST", "LEAST", "LOOK", "PATIENCE", "LEFT"}
FUNCTION_IMPORTS_MAX = 20
FORMAT_SKIPS_MAX = 20


@cache
def tree_of(path):
    return ast.parse(path.read_text())


@cache
def nodes_of(path):
    """All nodes of a file."""
    return list(ast.walk(tree_of(path)))


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in SOURCES}


def short_name(path):
    return str(path.relative_to(ROOT / "diffbotctl").with_suffix(""))


def import_nodes(nodes):
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(path):
    """Names that a file imports (`module` or `module.name`), with their lines."""
    for node in import_nodes(nodes_of(path)):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}:{node.lineno} write the import from `diffbotctl` on"
        prefix = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
        for alias in node.names:
            yield prefix + alias.name, node.lineno


def imported_modules(path):
    """Modules of the package that a file imports, anywhere in it."""
    for name, _ in imports(path):
        module = name if name in MODULES else name.rpartition(".")[0]
        if module in MODULES and MODULES[module] != path:
            yield module


def top_name(path):
    """The folder below `diffbotctl`, or the top-level module, of a file."""
    return path.relative_to(ROOT / "diffbotctl").parts[0].removesuffix(".py")


def place(path, line):
    return f"{path.relative_to(ROOT)}:{line}"


def circle(graph):
    """The nodes of one circle, or none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def test_imports_run_one_way():
    for path in SOURCES:
        here = LAYER.get(top_name(path))
        assert here is not None, (
            f"{path.relative_to(ROOT)} is in no layer, so nothing limits what it imports; "
            "add its folder to LAYERS"
        )
        for name, line in imports(path):
            steps = name.split(".")
            assert steps[0] not in ("tests", "prove"), (
                f"{place(path, line)} imports {name}, which is not installed; "
                "move what it needs into the package"
            )
            if steps[0] == "diffbotctl" and len(steps) > 1 and steps[1] in LAYER:
                assert LAYER[steps[1]] <= here, (
                    f"{place(path, line)} imports {name}, which is in a higher layer; "
                    "move what both need down to the lower one"
                )


def test_modules_import_in_no_circle():
    graph = {module: set(imported_modules(path)) for module, path in MODULES.items()}
    found = circle(graph)
    assert not found, (
        f"{' -> '.join(found)}: modules in a circle cannot be understood or tested one by one; "
        "move what both need into a third module, or pass it as an argument"
    )


def test_folders_import_in_no_circle():
    graph = defaultdict(set)
    for path in SOURCES:
        for module in imported_modules(path):
            if top_name(path) != top_name(MODULES[module]):
                graph[top_name(path)].add(top_name(MODULES[module]))
    found = circle(graph)
    assert not found, (
        f"{' -> '.join(found)}: folders in a circle are one folder; "
        "move what both need down to a lower one"
    )


def c_sources(folder):
    """Text without comments of each C file, by module: a header and its source are one."""
    modules = defaultdict(dict)
    for path in sorted(folder.glob("*.[ch]")):
        text = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)
        modules[path.stem][path.suffix] = text
    return modules


# Sources that a program for one kind of chip leaves out: those of the other.
OF_AVR = ("avr", "interrupts", "two_wire", "board_mega2560", "board_atmega328p", "bridge")
OF_RP2040 = ("rp2040", "board_rp2040")


@pytest.mark.parametrize(
    ("folder", "left_out"),
    [("firmware", OF_RP2040), ("firmware", OF_AVR), ("firmware/emulator", ("none",))],
    ids=["avr", "rp2040", "emulator"],
)
def test_c_modules_include_and_call_in_no_circle(folder, left_out):
    modules = c_sources(ROOT / folder)
    for module, texts in modules.items():
        if module.startswith(left_out):
            texts.pop(".c", None)
    owner = {}
    for module, texts in modules.items():
        source = texts.get(".c", "")
        functions = re.findall(r"^(?!static)\w[\w \*]*\b(\w+)\([^;{]*\)\s*\{", source, re.MULTILINE)
        variables = re.findall(
            r"^(?!static|typedef|extern)\w+ (\w+)(?:\[\w*\])?(?: =[^;]*)?;", source, re.MULTILINE
        )
        owner |= dict.fromkeys([*functions, *variables], module)
    assert len(owner) > len(modules), "no definitions found: the patterns above need a change"
    graph = {}
    for module, texts in modules.items():
        whole = "\n".join(texts.values())
        includes = set(re.findall(r'#include "(\w+)\.h"', whole)) & modules.keys()
        uses = {owner[word] for word in re.findall(r"\w+", texts.get(".c", "")) if word in owner}
        graph[module] = (includes | uses) - {module}
    found = circle(graph)
    assert not found, (
        f"{folder}: {' -> '.join(found)}: modules in a circle cannot be understood or tested one "
        "by one; let the caller pass what is needed, or move it into a third module"
    )


def test_blocks_protocols_and_plant_use_no_clock_randomness_or_file():
    pure = [path for path in SOURCES if top_name(path) in ("blocks", "links", "plant")]
    for path in pure:
        for name, line in imports(path):
            if name == "random.Random":
                continue  # the class of the seeded generator that the plant is given
            assert name.split(".")[0] not in IMPURE, (
                f"{place(path, line)} imports {name}: a replay could differ from its recording; "
                "take time and inputs as arguments"
            )


def test_public_classes_have_distinct_names():
    places = defaultdict(list)
    for path in SOURCES:
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(place(path, node.lineno))
    shared = {name: found for name, found in places.items() if len(found) > 1}
    assert not shared, (
        f"classes with one name: {shared}; a reader cannot tell which is meant: "
        "name each after what it stands for"
    )


def test_modules_are_not_too_small():
    small = {
        short_name(path)
        for path in SOURCES
        if path.name != "__init__.py"
        and len(path.read_text().splitlines()) <= SMALL_MODULE_LINES
        and short_name(path) not in SMALL_MODULES
    }
    assert not small, (
        f"at most {SMALL_MODULE_LINES} lines: {sorted(small)}; a reader opens a file for a few "
        "lines: merge it into its capability, or list it in SMALL_MODULES with a reason"
    )
    assert len(SMALL_MODULES) <= 15, "SMALL_MODULES is a list of exceptions: keep it at 15"


def folder_lines():
    """Lines of Python by folder of the package."""
    lines = defaultdict(int)
    for path in SOURCES:
        parts = path.relative_to(ROOT / "diffbotctl").parts
        lines[parts[0] if len(parts) > 1 else "."] += len(path.read_text().splitlines())
    return {folder: count for folder, count in lines.items() if count}


def test_folders_keep_their_budgets():
    lines = folder_lines()
    assert lines.keys() == BUDGETS.keys(), (
        f"{sorted(lines.keys() ^ BUDGETS.keys())}: each folder has a budget in BUDGETS, and each "
        "budget a folder"
    )
    over = {
        name: f"{lines[name]} of {limit}" for name, limit in BUDGETS.items() if lines[name] > limit
    }
    assert not over, (
        f"more lines than the budget: {over}. The package doubled once without a measured gain: "
        "delete or merge as much as was added, or raise the number in BUDGETS and state "
        "in the commit what a user gets for it"
    )


STATE_WORDS = {"state", "mode", "phase", "stage", "status"}
STATE_TEXTS = {"cli/engines": "a sentence such as `stopped by guard`, and a key of the JSON"}


def test_states_are_enumerations_or_literals():
    """A field or argument of this name that is annotated `str` may be misspelt unseen."""
    for path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                name, annotation = node.target.id, node.annotation
            elif isinstance(node, ast.arg) and node.annotation is not None:
                name, annotation = node.arg, node.annotation
            else:
                continue
            is_text = isinstance(annotation, ast.Name) and annotation.id == "str"
            is_state = name in STATE_WORDS and short_name(path) not in STATE_TEXTS
            assert not (is_text and is_state), (
                f"{place(path, node.lineno)} {name}: str; mypy finds no misspelt word in it: make "
                "it a StrEnum or a Literal"
            )


def assigned_names(path):
    for node in nodes_of(path):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Name):
                    yield target.id, node


def test_constants_name_their_quantity():
    vague = [
        f"{place(path, node.lineno)} {name}"
        for path in SOURCES
        for name, node in assigned_names(path)
        if name.lstrip("_") in VAGUE_CONSTANTS
    ]
    assert not vague, (
        f"{vague} say nothing outside their file; name the quantity, its limit and its unit: "
        "STOP_TIMEOUT_S, POLL_PERIOD_S, MAX_DATAGRAM_BYTES"
    )


def test_units_of_time_are_defined_once():
    for path in SOURCES:
        for name, node in assigned_names(path):
            assert name not in ("SECOND", "MILLISECOND", "MICROSECOND", "NEVER") or (
                short_name(path) == "time"
            ), f"{place(path, node.lineno)} defines {name} again; import it from diffbotctl.time"


def declared_parameters():
    """Names of `name = Param(...)` in class bodies, with their places."""
    for path in SOURCES:
        for owner in nodes_of(path):
            for node in owner.body if isinstance(owner, ast.ClassDef) else ():
                if (
                    isinstance(node, ast.Assign)
                    and isinstance(node.value, ast.Call)
                    and isinstance(node.value.func, ast.Name)
                    and node.value.func.id == "Param"
                ):
                    yield node.targets[0].id, place(path, node.lineno)


def test_declared_parameters_are_read():
    read = set()
    for path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
                read.add(node.attr)
            elif (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id in ("In", "Every", "FromRobot", "getattr")
            ):  # a port's period, freshness or robot field may be given by a parameter's name
                texts = [*node.args, *(keyword.value for keyword in node.keywords)]
                for text in texts:
                    if isinstance(text, ast.Constant) and isinstance(text.value, str):
                        read.update(text.value.split("."))
    unread = [f"{where} {name}" for name, where in declared_parameters() if name not in read]
    assert not unread, (
        f"{unread}: a user sets them and nothing changes; read them, or remove the declaration"
    )


def function_imports():
    """Imports inside functions, outside the commands, with whether a comment gives the reason."""
    for path in SOURCES:
        if top_name(path) == "cli":
            continue
        lines = path.read_text().splitlines()
        inside = {
            node
            for function in nodes_of(path)
            if isinstance(function, FUNCTIONS)
            for node in import_nodes(ast.walk(function))
        }
        has_reason = False
        last_line = 0
        for node in sorted(inside, key=lambda node: node.lineno):
            if node.lineno != last_line + 1:  # the first import of a group
                has_reason = lines[node.lineno - 2].lstrip().startswith("#")
            last_line = node.end_lineno
            has_reason |= any("#" in line for line in lines[node.lineno - 1 : last_line])
            yield place(path, node.lineno), has_reason


def test_function_level_imports_are_few_and_explained():
    found = list(function_imports())
    assert len(found) <= FUNCTION_IMPORTS_MAX, (
        f"{[where for where, _ in found]}: they hide what a module depends on; import at the top, "
        "except a heavy or optional library"
    )
    unexplained = [where for where, reason in found if not reason]
    assert not unexplained, (
        f"{unexplained} import inside a function without saying why; "
        "give the reason in a comment on the line or the line above"
    )


def test_format_is_rarely_skipped():
    skips = [
        place(path, number)
        for folder in ("diffbotctl", "tests", "prove")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if re.search(r"#\s*fmt:\s*(skip|off)\s*$", line)
    ]
    assert len(skips) <= FORMAT_SKIPS_MAX, (
        f"{skips}: hand-set lines are longer than a reader's screen and hide length; "
        "let ruff format them, or move a table into a data file"
    )


def test_printed_texts_are_broken_where_a_paragraph_ends():
    wide = [
        place(path, node.lineno)
        for folder in ("cli", "flash")
        for path in sorted((ROOT / "diffbotctl" / folder).glob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        # A module's docstring is in line 1, the lines of others are indented.
        if node.lineno > 1 and re.search(r"(?m)^.{81,}\n(?=\S)", node.value)
    ]
    assert not wide, f"{wide}: the terminal folds the line, and the next one begins too soon"


def test_every_package_ships():
    metadata = configparser.ConfigParser()
    metadata.read(ROOT / "setup.cfg")
    listed = set(metadata["options"]["packages"].split())
    folders = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in SOURCES
        if path.name == "__init__.py"
    }
    missing = folders - listed
    assert not missing, f"setup.cfg does not list {missing}: the wheel would lack them"


def test_help_imports_nothing_heavy():
    code = (
        "import sys; sys.argv = ['diffbotctl', '--help']\n"
        "from diffbotctl.cli.main import main\n"
        "try: main()\nexcept SystemExit: pass\n"
        "heavy = {'numpy', 'rich', 'jsonschema', 'yaml', 'serial', 'mcap', 'textual'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "HEAVY []" in out.stdout, "import heavy libraries inside the command that uses them"


REAL_RUN = """
import os, sys
from pathlib import Path
from diffbotctl.config.load import load
from diffbotctl.runs.options import SocketOptions
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

port = os.ttyname(os.openpty()[1])
configuration = load("goal", sys.argv[1], (), real=True)
folder = Path(sys.argv[2])
options = RunOptions(
    port, duration=0.1, record=folder / "a.mcap", log=folder / "log", socket=SocketOptions()
)
Run(configuration, options, tell=lambda text: None).go()
print("SIMULATION", [name for name in sys.modules if name.startswith(
    ("diffbotctl.plant", "diffbotctl.emulator")
)])
"""


@pytest.mark.parametrize("robot", ["book_2wd", "book_2wd_stock"])
def test_a_run_on_a_real_port_imports_neither_plant_nor_emulator(robot, tmp_path):
    import subprocess
    import sys

    command = [sys.executable, "-c", REAL_RUN, robot, str(tmp_path)]
    out = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert "SIMULATION []" in out.stdout, (
        f"a run on a serial port imports {out.stdout.strip()}: simulation code costs start-up time "
        "and must not decide what a real robot does; move what both need below `plant`, or import "
        "the simulator inside the branch for a simulated port"
    )


@pytest.mark.parametrize("folder", ["prove", "tests"])
def test_proof_and_tests_share_only_the_support(folder):
    other = {"prove": "tests", "tests": "prove"}[folder]
    for path in sorted((ROOT / folder).rglob("*.py")):
        text = path.read_text()
        for node in import_nodes(ast.walk(ast.parse(text))) if other in text else ():
            names = (
                [node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
            )
            names = [name for name in names if not name.startswith("tests.support")]
            assert other not in [name.split(".")[0] for name in names], (
                f"{place(path, node.lineno)} imports {names}; move what both need to "
                "tests/support/, so that either can change without the other"
            )
