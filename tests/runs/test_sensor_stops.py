"""An obstacle stop by each type of distance sensor, on the simulated and on the emulated board."""

import re

from tests.sampling import each_once
from tests.support.running import cli
from tests.support.sensor_stops import (
    BEYOND,
    DRIVE_TIME_S,
    GAP_MIN,
    STOP_SETS,
    STOPPING_SENSORS,
    gap,
)


@each_once(kind=STOPPING_SENSORS, port=["sim", "emulated"])
def test_the_robot_stops_before_the_wall(tmp_path, kind, port):
    """Before the margin of 5 cm is used up, or where the sensor ceases to measure."""
    sensor = STOPPING_SENSORS[kind]
    goal = f"{BEYOND:g} 0 0deg"
    words = ["run", "goal", "--fast", "--port", port, "--goal", goal, "--for", f"{DRIVE_TIME_S}s"]
    for each in (*sensor.sets, *STOP_SETS):
        words += ["--set", each]
    code, output, complaints = cli(tmp_path, *words)
    assert code == 1, output + complaints
    assert re.search(r"stop at .*(too_close|obstacle)", output), output
    pose = re.search(r"pose x (\S+) m", output)
    assert pose is not None, output
    assert GAP_MIN < gap(float(pose.group(1))) < sensor.gap_max, output
