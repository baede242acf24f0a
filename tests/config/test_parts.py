"""The tables of parts have the columns, types and ranges that their schema states."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

import diffbotctl.parts

SCHEMA = json.loads((Path(__file__).parents[1] / "data/parts.schema.json").read_text())
TABLES = sorted(Path(diffbotctl.parts.__file__).parent.glob("*.yaml"))


def problems(table, rows):
    """What the schema refuses in `rows`, each with its place."""
    # Numbers of timers and ports are keys, which JSON has only as text.
    rows = json.loads(json.dumps(rows))
    schema = SCHEMA | {"$ref": f"#/$defs/{table}"}
    errors = jsonschema.Draft202012Validator(schema).iter_errors(rows)
    return [f"{'.'.join(map(str, error.path))}: {error.message}" for error in errors]


@pytest.mark.parametrize("path", TABLES, ids=lambda path: path.stem)
def test_each_row_is_as_its_schema_states(path):
    assert problems(path.stem, yaml.safe_load(path.read_text())) == []


@pytest.mark.parametrize(
    ("table", "row", "column", "value"),
    [
        ("motor_drivers", "l298n", "mode", "two_pins"),
        ("motor_drivers", "l298n", "source", ""),
        ("motor_drivers", "drv8833", "states", {"enable_low": "open"}),
        ("boards", "uno", "interupts", [2]),
        ("boards", "uno", "uarts", {0: [0]}),
        ("imus", "mpu6050", "addresses", [0x68, 200]),
        ("distance_sensors", "hc_sr04", "reach", -4.0),
        ("lidars", "ld06", "protocol", "ld06"),
        ("lidars", "lds01", "start", "b"),
        ("distance_sensors", "hc_sr04", "points", [[0.1, 1.0], [0.2, 0.5]]),
    ],
)
def test_the_schema_refuses_a_wrong_row(table, row, column, value):
    rows = diffbotctl.parts.rows(table)
    rows[row] = rows[row] | {column: value}
    found = problems(table, rows)
    assert found and all(problem.startswith(row) for problem in found)
