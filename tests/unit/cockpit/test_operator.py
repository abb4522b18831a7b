"""Commands of the operator: matching answers, results, and messages about a rig that does not answer."""

import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import pytest

from bridge.faults import FAULTS, Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import Received
from bridge.wire.payloads import parsed
from bridge.wire.topics import APPLIED, OPERATOR, PLANT_EVENT, Topic
from bridge.wire.words import words
from bridge.wire.zenoh_link import Bus, BusConfig, reads
from cockpit.live import operator, status
from cockpit.run.authority import make_certificates
from tests.system.ports import free_endpoint

READY, ARMED, DISARMED, FAULT = wire.READY, wire.ARMED, wire.DISARMED, wire.FAULT


class Rig:
    """A bus with a rig whose `answer` to a word is a list of messages; `begins` with others."""

    def __init__(self, begins: list[Any], answer: Callable[[wire.Operator], list[Any]]) -> None:
        self.words: list[wire.Operator] = []
        self._begins, self._answer = begins, answer
        self._listeners: dict[str, Callable[[Received], None]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def listen(self, topic: Topic, receive: Callable[[Received], None]) -> None:
        self._listeners[topic.name] = receive

    def publisher(self, _topic: Topic) -> Callable[[bytes], None]:
        def send(payload: bytes) -> None:
            self.words.append(parsed(wire.Operator, payload, OPERATOR.name))
            self.publish(self._begins if len(self.words) == 1 else [])
            self.publish(self._answer(self.words[-1]))

        return send

    def wait_for(self, _roles: list[str], _timeout_s: float) -> set[str]:
        return set()

    def publish(self, messages: list[Any]) -> None:
        for message in messages:
            topic = APPLIED if isinstance(message, wire.Applied) else PLANT_EVENT
            self._listeners[topic.name](Received(topic, message.SerializeToString(), 0))


def applied(state: int, cause: int = wire.POWER_UP, amplitude_m: float = 0.0) -> wire.Applied:
    return wire.Applied(guard_state=state, cause=cause, amplitude_m=amplitude_m)


def taken(word: wire.Operator, name: str) -> wire.Event:
    return wire.Event(code="OPERATOR", text=f"{name} by {word.who}", source="plant")


@pytest.fixture
def say(monkeypatch: pytest.MonkeyPatch) -> Callable[[Rig, str], operator.CommandOutcome]:
    for name, seconds in (("_ANSWER_S", 0.4), ("_AGAIN_S", 0.1), ("_SILENT_S", 0.2), ("_REFUSED_S", 0.05)):
        monkeypatch.setattr(operator, name, seconds)

    def call(rig: Rig, word: str) -> operator.CommandOutcome:
        monkeypatch.setattr(operator, "connected", lambda *_args: rig)
        return operator.send_command(BusConfig(), word)

    return call


def test_a_word_that_the_rig_took_and_did_is_done(say: Callable[[Rig, str], operator.CommandOutcome]) -> None:
    rig = Rig([applied(DISARMED)], lambda word: [taken(word, "ARM"), applied(ARMED, wire.CHECK_PASSED)])
    obeyed = say(rig, "ARM")
    assert (obeyed.done, obeyed.taken, obeyed.state, len(rig.words)) == (True, True, "ARMED", 1)


@pytest.mark.slow
def test_the_last_message_of_a_silent_rig_confirms_nothing(
    say: Callable[[Rig, str], operator.CommandOutcome],
) -> None:
    """A cut link leaves the last message from before, which shows the very state that the word asks for."""
    with pytest.raises(
        Fault, match=r"been silent for .* before that ARMED with no vibration: must answer ARM"
    ) as raised:
        say(Rig([applied(ARMED, wire.CHECK_PASSED)], lambda _word: []), "ARM")
    assert raised.value.kind is FAULTS["NO_PEER"]


@pytest.mark.slow
def test_an_answer_to_another_command_does_not_confirm_this_command(
    say: Callable[[Rig, str], operator.CommandOutcome],
) -> None:
    """Commands of another sender and earlier commands of this process end in the requested state too."""
    other = wire.Operator(who="somebody else")
    with pytest.raises(Fault, match=r"did not confirm RESET .* is DISARMED .*; send it again") as raised:
        say(Rig([], lambda _word: [taken(other, "RESET"), applied(DISARMED)] * 3), "RESET")
    assert raised.value.kind is FAULTS["NO_PEER"]


@pytest.mark.slow
def test_a_check_that_takes_longer_than_an_answer_is_waited_for(
    say: Callable[[Rig, str], operator.CommandOutcome],
) -> None:
    rig = Rig([], lambda word: [taken(word, "ARM")])

    def check() -> None:
        for _ in range(20):
            rig.publish([applied(wire.CHECKING, wire.ARMED_BY_PERSON)])
            time.sleep(0.04)
        rig.publish([applied(ARMED, wire.CHECK_PASSED)])

    thread = threading.Thread(target=lambda: (time.sleep(0.1), check()))
    thread.start()
    obeyed = say(rig, "ARM")
    thread.join()
    assert (obeyed.done, obeyed.state) == (True, "ARMED")
    assert obeyed.seconds > 0.4


def test_a_rig_without_a_guard_has_nothing_to_arm(say: Callable[[Rig, str], operator.CommandOutcome]) -> None:
    armed = say(Rig([], lambda _word: [applied(wire.NO_GUARD, wire.NO_CAUSE, 37e-9)]), "ARM")
    assert armed.done
    assert armed.in_words() == [
        "arm      this rig has no guard, so it needs no arming: its controller may vibrate it already"
    ]
    disarmed = say(Rig([], lambda _word: [applied(wire.NO_GUARD, wire.NO_CAUSE, 37e-9)]), "DISARM")
    assert not disarmed.done
    assert "`stickslip stop`" in disarmed.in_words()[0]


def test_the_state_before_the_rig_took_the_command_does_not_count(
    say: Callable[[Rig, str], operator.CommandOutcome],
) -> None:
    """An armed rig with an unchecked exciter is checked again; the message before the check shows it armed."""
    answers = [[applied(ARMED, wire.CHECK_PASSED)], []]

    def answer(word: wire.Operator) -> list[Any]:
        return [*answers.pop(0), *([] if answers else [taken(word, "ARM"), applied(FAULT, wire.EXCITER_SILENT)])]

    obeyed = say(Rig([], answer), "ARM")
    assert (obeyed.done, obeyed.taken, obeyed.cause) == (False, True, "EXCITER_SILENT")


def test_two_words_of_one_process_are_two(say: Callable[[Rig, str], operator.CommandOutcome]) -> None:
    rigs = [Rig([], lambda word: [taken(word, "RESET"), applied(DISARMED)]) for _ in range(2)]
    assert all(say(rig, "RESET").done for rig in rigs)
    assert rigs[0].words[0].who != rigs[1].words[0].who


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        (applied(wire.ACTIVE, amplitude_m=37e-9), "ACTIVE with a vibration of 37 nm after a stop: must be at rest"),
        (applied(FAULT, wire.STOP_BY_PERSON, 1e-9), "FAULT with a vibration of 1 nm after a stop"),
    ],
)
@pytest.mark.slow
def test_a_stop_that_does_not_stop_is_a_fault(
    say: Callable[[Rig, str], operator.CommandOutcome], answer: wire.Applied, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operator, "_SILENT_S", 10.0)
    with pytest.raises(Fault, match=line):
        say(Rig([], lambda word: [taken(word, "STOP"), answer]), "STOP")


def test_a_rig_at_rest_after_a_stop_is_stopped_whoever_sent_it(
    say: Callable[[Rig, str], operator.CommandOutcome],
) -> None:
    assert say(Rig([], lambda _word: [applied(FAULT, wire.STOP_BY_PERSON)]), "STOP").done


@pytest.mark.parametrize(
    ("word", "advice"), [("STOP", "by hand"), ("DISARM", "by hand"), ("ARM", "start one"), ("RESET", "start one")]
)
@pytest.mark.slow
def test_without_a_rig_the_advice_depends_on_the_command(
    monkeypatch: pytest.MonkeyPatch, word: str, advice: str
) -> None:
    monkeypatch.setattr(operator, "_DIAL_S", 0.2)
    with pytest.raises(Fault, match="no rig answered at") as raised:
        operator.send_command(BusConfig(endpoint=free_endpoint()), word)
    assert ("by hand" in str(raised.value), "start one, or give its --endpoint" in str(raised.value)) == (
        advice == "by hand",
        advice == "start one",
    )


@pytest.mark.slow
def test_where_no_rig_answers_a_certificate_the_authority_is_asked_about(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(operator, "_DIAL_S", 0.2)
    for name in ("own", "other"):
        make_certificates(tmp_path / name, [])
    endpoint = free_endpoint().replace("tcp/", "tls/")
    config, other = (BusConfig(endpoint=endpoint, certificates=str(tmp_path / name)) for name in ("own", "other"))

    def refusals() -> list[str]:
        lines: list[str] = []
        for ask in (lambda: operator.send_command(config, "ARM"), lambda: status.look(config)):
            with pytest.raises(Fault, match=r"no rig answered .*the authority of --certs must be those") as raised:
                ask()
            lines.append(raised.value.line)
        return lines

    assert not any("REFUSED" in line for line in refusals())
    with Bus(other, "plant", lockstep=False):
        assert all("it refused this session" in line and ".users" not in line for line in refusals())


def test_a_rig_that_cannot_listen_reports_the_reason() -> None:
    config = BusConfig(endpoint=free_endpoint())
    with (
        socket.create_server(("127.0.0.1", config.port)),
        pytest.raises(
            Fault, match=r"Address already in use \(os error 98\).*; end the process that holds it, or choose"
        ) as raised,
    ):
        Bus(config, "plant", lockstep=True)
    assert ("..." in str(raised.value), ".rs:" in str(raised.value)) == (False, False)


def test_the_help_of_a_mode_does_not_name_a_reason_that_is_not_there() -> None:
    (disabled,) = (entry for entry in words() if (entry.column, entry.word) == ("mode", "DISABLED"))
    assert "the rig is not armed" in disabled.help


@pytest.mark.slow
def test_a_process_that_listens_and_does_not_read_is_frozen(monkeypatch: pytest.MonkeyPatch) -> None:
    config = BusConfig(endpoint=free_endpoint())
    assert reads(config) is None
    with socket.create_server(("127.0.0.1", config.port)):
        assert reads(config) is False
        monkeypatch.setattr(operator, "_DIAL_S", 0.2)
        with pytest.raises(
            Fault, match=r"STOP NOT DELIVERED: .* does not answer .*: must run; assume that the exciter still vibrates"
        ) as raised:
            operator.send_command(config, "STOP")
    assert raised.value.kind is FAULTS["NO_PEER"]


@pytest.mark.parametrize(("word", "advice"), [("STOP", "cut its amplifier"), ("ARM", "cut its amplifier")])
def test_a_missing_password_is_named_instead_of_a_missing_rig(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, word: str, advice: str
) -> None:
    for name in ("XDG_RUNTIME_DIR", "XDG_CACHE_HOME", "TMPDIR"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setattr("cockpit.live.listener.reads", lambda _config: True)
    monkeypatch.setattr(operator, "_DIAL_S", 0.1)
    config = BusConfig(endpoint=free_endpoint())
    with (
        socket.create_server(("127.0.0.1", config.port)),
        pytest.raises(
            Fault, match=rf"{word} NOT DELIVERED: a process listens .*{config.port}\.users is in none .*; .*{advice}"
        ),
    ):
        operator.send_command(config, word)
