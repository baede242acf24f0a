"""`make bench` measures what it says: the engine and the direct calls do the same."""

from prove import bench


def test_the_direct_calls_give_the_commands_of_the_engine():
    graph, blocks = bench.five_steps()
    calls, commands, computed = bench.direct(blocks), [], []
    compiled = graph.compile({"gate.wheels": lambda _, command: commands.append(command)}, None)
    for tick in range(1500):
        now, encoders, goal = bench.inputs(tick)
        values = {"robot.encoders": encoders, "operator.goal": goal if tick == 0 else None}
        compiled.instant(now, *(values.get(name) for name in graph.sources))
        computed.append(calls(now, encoders, goal))
    assert commands[-1].left > 1.0 and computed == commands


def test_every_row_of_the_engine_and_of_the_simulation_is_measured():
    sizes = bench.BRIEF
    rows = [*bench.overhead(sizes.ticks), *bench.simulated_speed(sizes.runs)]
    assert len(rows) == 4 and all(row.figure for row in rows)
