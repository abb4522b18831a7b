"""The table of topics: message, sender, rate, largest age, and whether the log keeps the topic."""

from typing import NamedTuple

from google.protobuf.message import Message

from bridge.wire import stickslip_pb2 as wire


class Topic(NamedTuple):
    """One row of the table. The Zenoh key is PREFIX/NAME, the MCAP topic /NAME."""

    name: str
    message: type[Message]
    sender: str
    rate_Hz: float  # expected rate; 0: irregular
    stale_after_s: float  # age from which the value of a message is dropped; 0: never
    logged: bool


SENSORS = Topic("sensors", wire.SensorBlock, "plant", 1000.0, 0.02, logged=True)
APPLIED = Topic("applied", wire.Applied, "plant", 1000.0, 0.0, logged=True)
COMMAND = Topic("command", wire.Command, "controller", 1000.0, 0.05, logged=True)
TRACE = Topic("trace", wire.Trace, "controller", 1000.0, 0.0, logged=True)
STATE = Topic("state", wire.State, "controller", 100.0, 0.0, logged=True)
SNAPSHOT = Topic("snapshot", wire.Snapshot, "controller", 1.0, 0.0, logged=True)
PLANT_EVENT = Topic("event/plant", wire.Event, "plant", 0.0, 0.0, logged=True)
CONTROLLER_EVENT = Topic("event/controller", wire.Event, "controller", 0.0, 0.0, logged=True)
RECORDER_EVENT = Topic("event/recorder", wire.Event, "recorder", 0.0, 0.0, logged=True)
OPERATOR = Topic("operator", wire.Operator, "cockpit", 0.0, 0.0, logged=False)
ANNOUNCE = Topic("announce", wire.Announce, "plant", 0.0, 0.0, logged=True)
FAULT = Topic("fault", wire.Inject, "cockpit", 0.0, 0.0, logged=False)

TOPICS = (  # a log's channels are numbered in this order
    *(SENSORS, APPLIED, COMMAND, TRACE, STATE, SNAPSHOT, PLANT_EVENT, CONTROLLER_EVENT, RECORDER_EVENT, OPERATOR),
    *(ANNOUNCE, FAULT),
)
BY_NAME = {topic.name: topic for topic in TOPICS}
SCOPE = Topic("scope", wire.Scope, "recorder", 200.0, 0.0, logged=True)  # made for viewers: in the log, not on the bus


class Outgoing(NamedTuple):
    """A message that a node hands to its link for sending."""

    topic: Topic
    payload: bytes
