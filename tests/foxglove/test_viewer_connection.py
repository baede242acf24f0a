"""One viewer of the server, without a network."""

import asyncio
import gc
import warnings
from types import SimpleNamespace

from aiohttp import WSMsgType

from diffbotctl.foxglove.viewer_connection import ViewerConnection


async def read_graph():
    return {}


def test_requests_of_a_viewer_that_leaves_at_once_cause_no_warning():
    async def leave():
        host = SimpleNamespace(limits=None, read_graph=read_graph)
        viewer = ViewerConnection(host, "viewer 1")
        for _ in range(2000):
            viewer._frame_received(WSMsgType.TEXT, '{"op": "subscribeConnectionGraph"}')
        for task in viewer.tasks:
            task.cancel()
        await asyncio.wait(viewer.tasks)

    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        asyncio.run(leave())
        gc.collect()
    assert [str(each.message) for each in found] == []
