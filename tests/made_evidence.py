"""Evidence folders of the plant, made once and shared: by all tests, by all worker processes, and by later runs.

A test that writes into a folder copies it first. The key of a folder is its case, its seed, the sources of plant, evidence and
bridge, and the versions of the packages. Old folders are deleted.
"""

import hashlib
import shutil
import tempfile
import time
from functools import cache
from pathlib import Path

from diagnosis.synthetic.folder import Case, make_evidence

ROOT = Path(__file__).parents[1]
KEPT = ROOT / ".pytest_cache" / "d" / "made-evidence"  # where `pytest --cache-clear` deletes it
MAKERS = ("bridge", "plant", "diagnosis/evidence", "diagnosis/synthetic")
_KEPT_S = 3600.0  # folders of other sources: another run, of before an edit, may still read them


def made_evidence(case: Case, seed: int) -> Path:
    """The folder of a case; the same case and seed have the same bytes."""
    folder = KEPT / digest_of(ROOT) / _name(case, seed)
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix="part-", dir=folder.parent))
        make_evidence(part, case, seed)
        try:
            part.rename(folder)
        except OSError:  # another process has made the same folder
            shutil.rmtree(part)
    return folder


def forget_old() -> None:
    """Delete folders of other sources that are an hour old or more."""
    for folder in KEPT.glob("*"):
        if folder.name != digest_of(ROOT) and time.time() - folder.stat().st_mtime > _KEPT_S:
            shutil.rmtree(folder)


def _name(case: Case, seed: int) -> str:
    axis = Path(__file__).with_name("made_protocols.py").read_bytes() if case.drive == "force" else b""
    return hashlib.sha256(repr((case, seed)).encode() + axis).hexdigest()[:16]


@cache
def digest_of(root: Path) -> str:
    """A hash over all that makes evidence, and over the versions of the packages, of the checkout at `root`."""
    digest = hashlib.sha256((root / "requirements.lock").read_bytes())
    for place in MAKERS:
        for path in sorted((root / place).rglob("*.py")):
            digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:16]
