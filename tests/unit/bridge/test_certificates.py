"""The end of a certificate: warned of 30 days before, and named where a session is refused."""

import datetime
from pathlib import Path

import pytest

from bridge.faults import FAULTS, Fault
from bridge.wire import certificates
from bridge.wire.session import role_security
from bridge.wire.zenoh_link import BusConfig
from cockpit.run.authority import make_certificates


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("certificates")
    make_certificates(made, [])
    return made


@pytest.mark.parametrize(
    ("days", "files"), [(0, []), (794, []), (796, ["rig"]), (826, ["rig"]), (3630, ["authority", "rig"])]
)
def test_a_certificate_warns_from_30_days_before_its_end(
    folder: Path, days: int, files: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=days)
    monkeypatch.setattr(certificates, "_now", lambda: now)
    text = certificates.expiring(certificates.ends_of("rig", folder))
    assert [name for name in ("authority", "rig") if f"{name}.pem: this certificate expire" in text] == files
    assert ("expired on" in text) == (days > 825)


def test_an_expired_certificate_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = BusConfig(endpoint="tls/127.0.0.1:1", certificates=str(folder))
    assert role_security(config, "operator")
    now = datetime.datetime.now(datetime.UTC) + datetime.timedelta(days=826)
    monkeypatch.setattr(certificates, "_now", lambda: now)
    with pytest.raises(
        Fault, match=r"operator\.pem: this certificate expired on \d{4}-\d\d-\d\d: no session accepts it"
    ) as raised:
        role_security(config, "operator")
    assert raised.value.kind is FAULTS["NOT_SECURE"]


def test_a_file_that_is_no_certificate_has_no_end(tmp_path: Path) -> None:
    for text in (
        "",
        "-----BEGIN CERTIFICATE-----\n%%%\n-----END CERTIFICATE-----",
        "-----BEGIN CERTIFICATE-----\nMAo=",
    ):
        (tmp_path / "rig.pem").write_text(text)
        assert certificates.ends_of("rig", tmp_path) == []
