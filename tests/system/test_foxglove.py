"""`stickslip serve --foxglove`: the real library and a client of its protocol, https://github.com/foxglove/ws-protocol."""

import asyncio
import base64
import itertools
import json
import sys
from typing import Any

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool
from google.protobuf.message_factory import GetMessageClass
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from bridge.faults import Fault, install
from cockpit.live.view import View
from cockpit.run.child_process import exit_status_of
from tests.unit.cockpit.live.made import Rig

_MESSAGE = 1  # opcode of "message data": then the subscription (4 bytes), the time (8 bytes), the payload


def decoder(channel: dict[str, Any]) -> Any:
    """The message class that a client builds from the server's description of a channel."""
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


async def received(port: int, rig: Rig, tell: Any) -> dict[str, list[tuple[int, Any]]]:
    """Messages of a slip that a client of all topics receives, by topic: time and message."""
    protocol = Subprotocol("foxglove.sdk.v1")
    async with connect(f"ws://127.0.0.1:{port}", subprotocols=[protocol], max_size=None) as client:
        channels: dict[str, Any] = {}
        while len(channels) < 2:
            answer = json.loads(await asyncio.wait_for(client.recv(), 10.0))
            if answer["op"] == "serverInfo":
                assert answer["capabilities"] == []
            channels |= {channel["topic"]: channel for channel in answer.get("channels", ())}
        wanted = [{"id": number, "channelId": channel["id"]} for number, channel in enumerate(channels.values())]
        await client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        names = dict(enumerate(channels))
        messages: dict[str, list[tuple[int, Any]]] = {name: [] for name in channels}
        number = 0
        while not all(messages.values()) or len(messages["/scope"]) < 10:
            for block in range(number, number + 10):
                rig.block(block, peak_N=17.0 if block % 40 == 13 else None)
                rig.answer(block)
                rig.applied(block)
            number += 10
            rig.event("GAP", f"before block {number}")
            tell()
            while True:
                try:
                    data = await asyncio.wait_for(client.recv(), 0.01)
                except TimeoutError:
                    break
                if isinstance(data, bytes) and data[0] == _MESSAGE:
                    name = names[int.from_bytes(data[1:5], "little")]
                    message = decoder(channels[name]).FromString(data[13:])
                    messages[name].append((int.from_bytes(data[5:13], "little"), message))
            assert number < 10_000
        return messages


@pytest.mark.nightly
def test_a_client_subscribes_and_decodes_signals_and_events() -> None:
    pytest.importorskip("foxglove", reason="make nightly installs the viewers")
    from cockpit.live.foxglove_server import Foxglove

    rig = Rig()
    view = View(rig, "here", rig.clock)
    with Foxglove(0) as server:
        with pytest.raises(Fault, match=f"ENDPOINT_BUSY.*{server.port}.*--foxglove-port"):
            Foxglove(server.port)
        messages = asyncio.run(received(server.port, rig, lambda: server.send(view.step())))
    times = [time for time, _ in messages["/scope"]]
    assert {later - time for time, later in itertools.pairwise(times)} == {5_000_000}
    scope = [message for _, message in messages["/scope"]]
    assert max(message.drive_force_max_N for message in scope) == 17.0
    assert {message.drive_force_min_N for message in scope} == {10.0}
    assert "mode: EXCITE" in str(scope[-1])
    _, event = messages["/log"][-1]
    assert event.message.startswith("GAP: before block ")
    assert event.name == "plant"


def test_without_the_extra_its_install_command_is_named(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    from cockpit.live.foxglove_server import Foxglove

    monkeypatch.setitem(sys.modules, "foxglove", None)
    assert exit_status_of(lambda: Foxglove(0) and None) != 0
    assert "MISSING_EXTRA" in (answer := capsys.readouterr().err)
    assert install("foxglove") in answer
