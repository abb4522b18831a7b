"""The settings of a Zenoh session: the rig listens, all others dial it; credentials and permissions of each role."""

import json
import os
import sys
from pathlib import Path
from typing import Any

# Zenoh reads this at its import. One thread for all messages instead of four, so that none passes from thread to thread. New
# connections have a separate thread: on the thread of the messages, 100 idle ones ended the vibration.
os.environ.setdefault(
    "ZENOH_RUNTIME",
    "(rx: (worker_threads: 1), net: (handover: rx), acc: (worker_threads: 1), tx: (handover: rx), app: (handover: rx))",
)
import zenoh

from bridge.faults import Fault
from bridge.wire import certificates, loopback_users
from bridge.wire.bus_config import BusConfig, is_loopback
from bridge.wire.topics import TOPICS

# Time after which a silent session is dropped. A process that ends closes its socket, so this concerns frozen processes only.
# Shorter: a stall of a process breaks its link: with four stalls of 0.7 to 0.9 s in 16 s, 0.75 s loses 1540 blocks of the log and
# 1850 of the controller; with 24 such stalls, 1.5 s loses none. Longer: a frozen controller is replaced later, only after the
# lease; the limit is 2 s (docs/method/rig.md).
LEASE_S = 1.5
# In lockstep no process has a deadline and no message may be lost, so the lease is Zenoh's default.
_LOCKSTEP_LEASE_S = 10.0
DIAL_S = 2.0  # longest attempt to dial the rig; a longer one delays a stop, as Zenoh cannot be stopped while it dials
# Longest message that a session assembles from its parts [bytes]; Zenoh drops a longer one. It equals the longest message that is
# read (bridge/wire/payloads.py). Larger: the rig relays messages that fill a queue of 16 parts of 64 kB; with congestion control
# BLOCK they stop the only thread of the rig's session until its links break: 10 s for a message of 3 MB.
_LARGEST_BYTES = 1 << 18
# In real time the rig drops messages instead of waiting for a receiver.
_NEVER_WAIT = [
    {
        "id": "never-wait",
        "messages": ["put"],
        "key_exprs": ["**"],
        "flows": ["ingress"],
        "overwrite": {"congestion_control": "drop"},
    }
]

# role of a session: its name as the sender in the table of topics
_SENDER = {"controller": "controller", "recorder": "recorder", "operator": "cockpit"}
# Zenoh's kinds of messages that the rig passes on to every role
_MESSAGE_KINDS = [
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip


def session_settings(config: BusConfig, hub: bool, lockstep: bool, dial_s: float = DIAL_S) -> dict[str, Any]:
    """The settings of a session by Zenoh's key; the `hub` listens, other sessions dial for `dial_s`."""
    return {
        "mode": "peer" if hub else "client",
        "listen/endpoints": [config.endpoint] if hub else [],
        "connect/endpoints": [] if hub else [config.endpoint],
        "connect/timeout_ms": 0 if hub else round(dial_s * 1e3),
        "connect/exit_on_failure": not hub,
        "connect/retry": {"period_init_ms": 20, "period_max_ms": 20, "period_increase_factor": 1},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": round(1e3 * (_LOCKSTEP_LEASE_S if lockstep else LEASE_S)),
        "transport/link/tx/keep_alive": 4,
        # Packets of 64 kB, about a hundred messages each, that may wait for a receiver: 2 by default, 16 at most. Smaller: a
        # stalled receiver loses blocks.
        "transport/link/tx/queue/size/data": 16,
        "transport/link/rx/max_message_size": _LARGEST_BYTES,
        # Pending connections without a handshake and their timeout [ms]; by default 100 for 10 s. With 110 of them an operator's
        # stop could not connect. Beyond the limit a connection is closed on the thread of the messages, which delays them, so the
        # limit is above the 1024 files of a process.
        "transport/unicast/accept_pending": 2000,
        "transport/unicast/accept_timeout": 1000,
        # Time [us] to wait for room in a queue before the parts of a long message are dropped, 50 000 by default. It blocks
        # all other messages.
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 1000,
        "qos/network": _NEVER_WAIT if hub and not lockstep else [],
        "transport/shared_memory/enabled": False,
    }


def session_config(
    config: BusConfig, hub: bool, lockstep: bool, dial_s: float = DIAL_S, security: dict[str, Any] | None = None
) -> zenoh.Config:
    """`session_settings` as Zenoh's configuration, with the settings of `rig_security` or `role_security`."""
    result = zenoh.Config()
    for key, value in (session_settings(config, hub, lockstep, dial_s) | (security or {})).items():
        result.insert_json5(key, json.dumps(value))
    return result


def rig_security(config: BusConfig) -> dict[str, Any]:
    """Security settings of the listening session: credentials and permissions of each role.

    Raises Fault NOT_SECURE for an endpoint that others can reach without TLS, and if a certificate or password is missing.
    """
    if config.encrypted:
        return tls_rig_security(
            config, certificates.checked(certificates.RIG, certificates.folder(config.certificates))
        )
    if config.insecure:
        line = f"{config.endpoint}: --insecure: any program that reaches this port can command the exciter"
        print(f"stickslip: warning: {line}", file=sys.stderr, flush=True)
        return {}
    if not is_loopback(config.endpoint):
        line = f"{config.endpoint}: other computers can reach it: must be an address of this computer alone, or tls/"
        remedy = "make certificates with `stickslip certs FOLDER` and use --endpoint tls/HOST:PORT --certs FOLDER"
        raise Fault("NOT_SECURE", f"{line}; {remedy}; --insecure allows it on a network of trusted computers alone")
    return loopback_rig_security(config, loopback_users.make(config.endpoint))


def tls_rig_security(config: BusConfig, files: certificates.RoleFiles) -> dict[str, Any]:
    """Security settings of a rig at a tls/ endpoint: roles are the common names of certificates."""
    settings = certificates.tls_settings(certificates.RIG, files)
    return settings | {"access_control": _access_control(config.prefix, "cert_common_names")}


def loopback_rig_security(config: BusConfig, users: Path) -> dict[str, Any]:
    """Security settings of a rig at an endpoint of this computer alone: roles are the names in the password file."""
    return {
        "transport/auth/usrpwd": {"dictionary_file": str(users)},
        "access_control": _access_control(config.prefix, "usernames"),
    }


def role_security(config: BusConfig, role: str) -> dict[str, Any]:
    """Credentials of a dialling session; empty if no rig of this user has made a password.

    Raises Fault NOT_SECURE if a certificate for a tls/ endpoint is missing.
    """
    if config.encrypted:
        return certificates.tls_settings(role, certificates.checked(role, certificates.folder(config.certificates)))
    password = loopback_users.password(config.endpoint, role)
    return {"transport/auth/usrpwd": {"user": role, "password": password}} if password is not None else {}


def _access_control(prefix: str, subject: str) -> dict[str, Any]:
    """Zenoh's `access_control` for the session of a rig, which relays all messages: permissions of each role.

    A message without a rule is denied. The rules do not bind the rig itself, as its session applies them.

    Args:
        prefix: prefix of the keys.
        subject: attribute that identifies the role: `usernames` or `cert_common_names`.

    """
    rules = [
        # messages that the rig relays: every role may receive all of them
        _rule("hear", ["egress"], _MESSAGE_KINDS, [f"{prefix}/**"]),
        _rule("listen", ["ingress"], ["declare_subscriber"], [f"{prefix}/**"]),
        _rule("ask", ["ingress"], ["query"], [f"{prefix}/header/*"]),
        _rule(
            "who-is-there",
            ["ingress"],
            ["liveliness_query", "declare_liveliness_subscriber"],
            [f"{prefix}/alive/*", f"{prefix}/claim/controller/*"],
        ),
    ]
    policies: list[dict[str, Any]] = [
        {"rules": ["hear", "listen", "ask", "who-is-there"], "subjects": list(loopback_users.ROLES)},
    ]
    for role in loopback_users.ROLES:
        extra = _role_rules(prefix, role)
        rules += extra
        if extra:
            policies.append({"rules": [rule["id"] for rule in extra], "subjects": [role]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": role, subject: [role]} for role in loopback_users.ROLES],
        "policies": policies,
    }


def _role_rules(prefix: str, role: str) -> list[dict[str, Any]]:
    """Permissions of this role alone."""
    sent = [f"{prefix}/{topic.name}" for topic in TOPICS if topic.sender == _SENDER.get(role)]
    rules = [_rule(f"{role}-says", ["ingress"], ["put"], sent)] if sent else []
    if role in {"controller", "recorder"}:
        tokens = [f"{prefix}/alive/{role}", f"{prefix}/claim/{role}/*"]
        rules.append(_rule(f"{role}-is-there", ["ingress"], ["liveliness_token"], tokens))
        header = [f"{prefix}/header/{role}"]
        rules.append(_rule(f"{role}-answers", ["ingress"], ["declare_queryable", "reply"], header))
    return rules


def _rule(name: str, flows: list[str], messages: list[str], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys}
