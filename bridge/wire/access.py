"""Permissions of each role on the bus: the access control of the rig's session, which relays all messages.

Everything not listed here is denied. The rules do not bind the rig itself, as its session applies them.
"""

from typing import Any

from bridge.wire.loopback_users import ROLES
from bridge.wire.topics import TOPICS

# sender in the table of topics, by role of a session
_SENDER = {"controller": "controller", "recorder": "recorder", "operator": "cockpit"}
# kinds of messages, from a session to the rig and back
_ALL = [
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip


def access_control(prefix: str, subject: str) -> dict[str, Any]:
    """Zenoh's `access_control` for the session of a rig.

    Args:
        prefix: prefix of the keys.
        subject: attribute that identifies the role: `usernames` or `cert_common_names`.

    """
    rules = [
        # messages that the rig relays: every role may receive all of them
        _rule("hear", ["egress"], _ALL, [f"{prefix}/**"]),
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
        {"rules": ["hear", "listen", "ask", "who-is-there"], "subjects": list(ROLES)},
    ]
    for role in ROLES:
        extra = _role_rules(prefix, role)
        rules += extra
        if extra:
            policies.append({"rules": [rule["id"] for rule in extra], "subjects": [role]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": role, subject: [role]} for role in ROLES],
        "policies": policies,
    }


def _role_rules(prefix: str, role: str) -> list[dict[str, Any]]:
    """Permissions of this role alone."""
    sent = [f"{prefix}/{topic.name}" for topic in TOPICS if topic.sender == _SENDER.get(role)]
    rules: list[dict[str, Any]] = []
    if sent:
        rules.append(_rule(f"{role}-says", ["ingress"], ["put"], sent))
    if role in {"controller", "recorder"}:
        tokens = [f"{prefix}/alive/{role}", f"{prefix}/claim/{role}/*"]
        rules.append(_rule(f"{role}-is-there", ["ingress"], ["liveliness_token"], tokens))
        header = [f"{prefix}/header/{role}"]
        rules.append(_rule(f"{role}-answers", ["ingress"], ["declare_queryable", "reply"], header))
    return rules


def _rule(name: str, flows: list[str], messages: list[str], keys: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys}
