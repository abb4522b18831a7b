"""A small certificate authority for the bus of one rig: one certificate per role, with the role as common name."""

import contextlib
import datetime
import ipaddress
import os
import socket
from pathlib import Path
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from bridge.faults import Fault
from bridge.wire.certificates import AUTHORITY, CLUSTER, RIG, files_of
from bridge.wire.loopback_users import ROLES
from cockpit.run.writable import writing

_AUTHORITY_DAYS = 3650
# Validity of a role's certificate, the longest that browsers accept. Longer: a lost key stays valid longer. Shorter: certificates
# are renewed more often.
_ROLE_DAYS = 825
_EARLIER = datetime.timedelta(minutes=5)  # valid from this time before now: the clock of a client may be behind


class Made(NamedTuple):
    """Result of `stickslip certs`."""

    folder: str
    hosts: list[str]  # names and addresses in the rig's certificate, under which clients may connect
    files: list[str]
    until: str  # last day of the roles' certificates


def make_certificates(folder: Path, hosts: list[str]) -> Made:
    """Make the certificates of all roles, signed by the authority in the folder, or by a new one. Keys have mode 0600.

    `hosts` are further names and addresses of the rig's computer. Raises Fault CONFIG for an invalid host name, LOG_WRITE if the
    folder is not writable, NOT_SECURE if a certificate exists already: a new key would lock out every client with the old one.
    """
    names = list(dict.fromkeys(["localhost", "127.0.0.1", "::1", socket.gethostname(), *hosts]))
    alternatives = [_alternative(name) for name in names]
    roles = (RIG, *ROLES, CLUSTER)
    existing = [path for role in roles for path in files_of(role, folder)[1:] if path.exists()]
    if existing:
        line = f"{existing[0]}: exists already and would be lost"
        raise Fault(
            "NOT_SECURE", f"{line}; choose another folder, or remove the certificates of the roles that get new ones"
        )
    with writing(folder):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        authority, authority_key = _authority(folder)
        for role in roles:
            _make_role(role, folder, authority, authority_key, alternatives if role == RIG else [])
    until = (_now() + datetime.timedelta(days=_ROLE_DAYS)).date().isoformat()
    return Made(str(folder), names, sorted(path.name for path in folder.iterdir()), until)


def _alternative(name: str) -> x509.GeneralName:
    with contextlib.suppress(ValueError):
        return x509.IPAddress(ipaddress.ip_address(name))
    try:
        return x509.DNSName(name)
    except ValueError:
        raise Fault(
            "CONFIG", f"--host {name}: must be an ASCII name or an address; give a name of the rig's computer"
        ) from None


def _authority(folder: Path) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    """Certificate and key of the authority in a folder; created if both files are missing."""
    certificate_path, key_path = folder / f"{AUTHORITY}.pem", folder / f"{AUTHORITY}.key"
    if certificate_path.exists() or key_path.exists():
        try:
            certificate = x509.load_pem_x509_certificate(certificate_path.read_bytes())
            key = serialization.load_pem_private_key(key_path.read_bytes(), None)
        except (OSError, ValueError, TypeError) as error:
            line = f"{folder}: its authority cannot be read ({error})"
            raise Fault(
                "NOT_SECURE", f"{line}; put {AUTHORITY}.pem and {AUTHORITY}.key there, or choose another folder"
            ) from None
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise Fault("NOT_SECURE", f"{key_path}: is not a key made by `stickslip certs`; choose another folder")
        return certificate, key
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "stickslip authority")])
    usage = x509.KeyUsage(
        digital_signature=False, content_commitment=False, key_encipherment=False, data_encipherment=False,
        key_agreement=False, key_cert_sign=True, crl_sign=True, encipher_only=False, decipher_only=False,
    )  # fmt: skip
    made = (
        _builder(name, name, key, _AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    _write(certificate_path, made.public_bytes(serialization.Encoding.PEM), 0o644)
    _write(key_path, _pem(key), 0o600)
    return made, key


def _make_role(
    role: str,
    folder: Path,
    authority: x509.Certificate,
    authority_key: ec.EllipticCurvePrivateKey,
    alternatives: list[x509.GeneralName],
) -> None:
    """Make key and certificate of a role. Only the rig's names its computer as a server: no other role can pose as the rig."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, role)])
    server, client = ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH
    uses = {RIG: [server], CLUSTER: [server, client]}.get(role, [client])
    builder = (
        _builder(name, authority.subject, key, _ROLE_DAYS)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), critical=False)
    )
    if alternatives:
        builder = builder.add_extension(x509.SubjectAlternativeName(alternatives), critical=False)
    made = files_of(role, folder)
    _write(made.key, _pem(key), 0o600)
    _write(
        made.certificate, builder.sign(authority_key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM), 0o644
    )


def _builder(name: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, days: int) -> x509.CertificateBuilder:
    now = _now()
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _EARLIER)
        .not_valid_after(now + datetime.timedelta(days=days))
    )


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


def _pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def _write(path: Path, data: bytes, mode: int) -> None:
    """Create a file with this mode from the start, so that a key is never readable by others; an existing file is an error."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        file.write(data)
