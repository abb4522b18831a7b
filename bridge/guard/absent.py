"""Channels that a rig does not have: those that the guard needs, and the protection that is lost without the others."""

from collections.abc import Collection, Mapping
from typing import Annotated

from pydantic import AfterValidator, Field

from bridge.config import Strict
from bridge.wire.channels import SENSOR_CHANNELS


def _known(name: str) -> str:
    if name not in SENSOR_CHANNELS:
        raise ValueError(f"{name}: no such channel; known: {', '.join(SENSOR_CHANNELS)}")
    return name


ChannelName = Annotated[str, AfterValidator(_known)]


class PresentOrAbsent(Strict):
    """The table `[channels.NAME]` of a simulated rig."""

    absent: bool = Field(default=False, description="true: the rig has no such sensor; its samples are zeros.")


def absent(channels: Mapping[str, PresentOrAbsent]) -> list[str]:
    """Names of the channels that a rig does not have."""
    return [name for name, channel in channels.items() if channel.absent]


def refusal(absent: Collection[str]) -> str:
    """The reason to refuse a rig without these channels, as text; empty if the guard needs none of them."""
    reasons = ((name, SENSOR_CHANNELS[name].needed) for name in absent)
    lines = [
        f"channels.{name}.absent = true: a rig needs this channel: {text}; connect it" for name, text in reasons if text
    ]
    return lines[0] if lines else ""


def lost_protection(absent: Collection[str]) -> list[str]:
    """The protection that a rig lacks without these channels, a text for each."""
    return [f"no {name}: {SENSOR_CHANNELS[name].guards}" for name in SENSOR_CHANNELS if name in absent]
