"""Parameters of the run's blocks as viewers have them, and the connection graph."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from diffbotctl.foxglove.protocol import Fields

Values = dict[str, Any]  # parameter to value
SERVER = "diffbotctl"  # who provides the services in the graph


def parameter_values(reply: Fields) -> Values:
    """Every parameter that has a value, from the reply to `list_parameters`."""
    return {
        row["parameter"]: row["value"] for row in reply["parameters"] if row["value"] is not None
    }


def parameter_rows(values: Values, names: Iterable[str]) -> list[Fields]:
    """The parameters `names`, or all without any, as the operation `parameterValues` has them."""
    chosen = list(names) or list(values)
    rows = []
    for name in chosen:
        if name in values:
            row = {"name": name, "value": values[name]}
            rows.append(row | {"type": "float64"} if isinstance(values[name], float) else row)
    return rows


def connection_graph(
    topics: Iterable[str], wires: Iterable[Fields], names: Iterable[str]
) -> Fields:
    """The fields of `connectionGraphUpdate`: blocks and wires of the run, and service `names`.

    `wires` are the rows of the reply to `list_wires`.
    """
    subscribers: dict[str, list[str]] = {}
    for row in wires:
        subscribers.setdefault(row["topic"], []).append(row["to"])
    return {
        "publishedTopics": [
            {"name": topic, "publisherIds": [topic.partition(".")[0]]} for topic in topics
        ],
        "subscribedTopics": [
            {"name": topic, "subscriberIds": sorted(set(blocks))}
            for topic, blocks in subscribers.items()
        ],
        "advertisedServices": [{"name": name, "providerIds": [SERVER]} for name in names],
        "removedTopics": [],
        "removedServices": [],
    }
