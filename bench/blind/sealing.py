"""A sealed set: evidence folders with meaningless names, a hash of every answer, and the answers in a key file elsewhere.

    SET/set.json        format, and per case SHA-256 of its answer with a nonce, and of its evidence
    SET/<case>/         evidence
    SET/results/        the result of every case, `<case>.json`
    SET/opened.json     when the set was scored for the first time, and the hash of the results at that time
    KEY                 per case nonce and answer; the answer also holds whether the seed of this set was published before

The set alone does not reveal an answer; the key's owner cannot change an answer afterwards.
"""

import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from bridge.faults import Fault
from bridge.files import read_json
from bridge.results import write_json
from diagnosis.version import tool_version

Answer = dict[str, Any]
SET_FORMAT, KEY_FORMAT, OPENED_FORMAT = "blind-set/1", "blind-key/1", "blind-opened/1"
SET, RESULTS, OPENED = "set.json", "results", "opened.json"


class Sealed(NamedTuple):
    """The hashes of one case, hexadecimal."""

    answer_sha256: str
    evidence_sha256: str


class Secret(NamedTuple):
    """The part of the key for one case."""

    nonce: str  # random, hexadecimal: without it the answer could be guessed from its hash
    answer: Answer


def answer_hash(secret: Secret) -> str:
    """SHA-256 of the nonce and the answer's canonical JSON (sorted keys, no spaces, ASCII). Raises ValueError for NaN."""
    canonical = json.dumps(secret.answer, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(f"{secret.nonce}\n{canonical}".encode("ascii")).hexdigest()


def evidence_hash(folder: Path) -> str:
    """SHA-256 over names and contents of a case's files. Raises OSError."""
    total = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        with path.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
        total.update(f"{path.relative_to(folder).as_posix()}\n{content}\n".encode())
    return total.hexdigest()


def refuse_key_inside(out: Path, key: Path) -> None:
    """Raise Fault CONFIG where the key would lie inside the set that it opens."""
    if key.resolve().is_relative_to(out.resolve()):
        raise Fault("CONFIG", f"--key {key}: must be outside {out}, or the answers go wherever the set goes")


def write_set(folder: Path, cases: Mapping[str, Secret]) -> None:
    """Write the hashes of the cases whose evidence is in `folder`. Raises OSError."""
    sealed = {name: Sealed(answer_hash(cases[name]), evidence_hash(folder / name))._asdict() for name in sorted(cases)}
    write_json(folder / SET, {"format": SET_FORMAT, "cases": sealed})


def write_key(path: Path, cases: Mapping[str, Secret]) -> None:
    """Write nonces and answers. Raises OSError."""
    secrets = {name: cases[name]._asdict() for name in sorted(cases)}
    write_json(path, {"format": KEY_FORMAT, "cases": secrets})


def read_set(folder: Path) -> dict[str, Sealed]:
    """The cases of a set. Raises Fault BAD_SET."""
    return {name: Sealed(**row) for name, row in _read(folder / SET, SET_FORMAT, Sealed._fields).items()}


def read_key(path: Path) -> dict[str, Secret]:
    """Nonces and answers of a key, by case. Raises Fault BAD_SET."""
    return {name: Secret(**row) for name, row in _read(path, KEY_FORMAT, Secret._fields).items()}


def _read(path: Path, wanted: str, fields: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    try:
        table = read_json(path)
    except OSError as error:
        raise Fault(
            "BAD_SET", f"{path}: cannot be read: {error.strerror}; `python -m tests.blind make` writes such a file"
        ) from None
    except ValueError as error:
        raise Fault(
            "BAD_SET", f"{path}: is not JSON ({error}); take the file that `python -m tests.blind make` wrote"
        ) from None
    form = table.get("format") if isinstance(table, dict) else None
    if form != wanted:
        raise Fault("BAD_SET", f"{path}: format = {form!r}: must be {wanted!r}; is it the right file?")
    cases = table.get("cases")
    if not isinstance(cases, dict) or not all(
        isinstance(row, dict) and row.keys() == set(fields) for row in cases.values()
    ):
        rule = f"must be a table of cases with {' and '.join(fields)} each"
        raise Fault("BAD_SET", f"{path}: cases: {rule}; take the file that `python -m tests.blind make` wrote")
    return cases


def opened_answers(folder: Path, key: Path) -> dict[str, Answer]:
    """The answers of a set, every hash checked. Raises Fault BAD_SET or SEAL_BROKEN."""
    sealed, secrets = read_set(folder), read_key(key)
    if sealed.keys() != secrets.keys():
        odd = min(sealed.keys() ^ secrets.keys())
        where = key if odd in sealed else folder / SET
        raise Fault(
            "SEAL_BROKEN", f"{where}: case {odd} is missing: set and key must name the same cases; find the key"
        )
    for name, hashes in sealed.items():
        if answer_hash(secrets[name]) != hashes.answer_sha256:
            line = f"{key}: case {name}: the answer was changed after it was sealed: its SHA-256 must be as in"
            raise Fault("SEAL_BROKEN", f"{line} {folder / SET}; the set cannot be scored")
        if evidence_hash(folder / name) != hashes.evidence_sha256:
            line = f"{folder / name}: the evidence was changed after it was sealed: its SHA-256 must be as in"
            raise Fault("SEAL_BROKEN", f"{line} {folder / SET}; the set cannot be scored")
    return {name: secrets[name].answer for name in sealed}


def mark_opened(folder: Path) -> bool:
    """Mark a set as opened; return whether its results were made before. Raises OSError or Fault BAD_SET.

    Results that changed after the first opening count as made with known answers.
    """
    results = evidence_hash(folder / RESULTS)
    path = folder / OPENED
    if not path.exists():
        now = datetime.now(UTC).isoformat(timespec="seconds")
        about = {"format": OPENED_FORMAT, "opened_UTC": now, "results_sha256": results, "tool": tool_version()}
        write_json(path, about)
        return True
    try:
        return bool(json.loads(path.read_text(encoding="utf-8"))["results_sha256"] == results)
    except (ValueError, KeyError, TypeError):
        raise Fault("BAD_SET", f"{path}: must hold the hash of the results; the set is development data") from None
