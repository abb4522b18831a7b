"""The files of deploy/zenoh, made from the settings that the project's own sessions use: `make reference` writes them."""

import json
from pathlib import Path
from typing import Any

from bridge.wire import certificates, loopback_users
from bridge.wire.bus_config import BusConfig
from bridge.wire.session import loopback_rig_security, session_settings, tls_rig_security

FOLDER = Path(__file__).parent.parent / "deploy" / "zenoh"
_MADE = "// Made by `make reference`. {about}\n"
_CERTIFICATES, _RUNTIME = Path("CERTIFICATES"), Path("RUNTIME")


def configurations() -> dict[str, str]:
    """Text of every file, by name; CERTIFICATES, RUNTIME, HOST and PASSWORD stand for the user's values."""
    loopback = BusConfig()
    secure = BusConfig(endpoint="tls/HOST:7447")
    users = _RUNTIME / "stickslip" / loopback_users.file_name(loopback.endpoint)
    made = {
        "rig-loopback.json5": (
            "A rig on one computer: a password for each role, in a file of mode 0600 with lines ROLE:PASSWORD.",
            session_settings(loopback, hub=True, lockstep=False) | loopback_rig_security(loopback, users),
        ),
        "client-loopback.json5": (
            "Anybody else on the rig's computer; the user is the role: controller, recorder, operator or viewer.",
            session_settings(loopback, hub=False, lockstep=False)
            | {"transport/auth/usrpwd": {"user": "viewer", "password": "PASSWORD"}},
        ),
        "rig-tls.json5": (
            "A rig that other computers reach, with the certificates of `stickslip certs`.",
            session_settings(secure, hub=True, lockstep=False)
            | tls_rig_security(secure, certificates.files_of(certificates.RIG, _CERTIFICATES)),
        ),
    }
    for role in loopback_users.ROLES:
        made[f"{role}-tls.json5"] = (
            f"The {role} at a rig that other computers reach.",
            session_settings(secure, hub=False, lockstep=False)
            | certificates.tls_settings(role, certificates.files_of(role, _CERTIFICATES)),
        )
    return {
        name: _MADE.format(about=about) + json.dumps(_nested(settings), indent=2) + "\n"
        for name, (about, settings) in made.items()
    }


def _nested(settings: dict[str, Any]) -> dict[str, Any]:
    """Settings with keys like `transport/link/tx/lease` as tables in tables."""
    result: dict[str, Any] = {}
    for key, value in settings.items():
        *above, last = key.split("/")
        table = result
        for part in above:
            table = table.setdefault(part, {})
        table[last] = value
    return result
