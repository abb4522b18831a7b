"""Which folder is lost with a worker that dies; tests/system/test_many.py kills real workers."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from joblib.externals.loky import BrokenProcessPool

from diagnosis import diagnose_many as many
from diagnosis.diagnose_many import EvidenceFolder, FolderResult


def test_a_folder_that_always_kills_its_worker_costs_no_other_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def one(source: EvidenceFolder, _task: Any) -> FolderResult:
        tried.append(source.name)
        if source.name == "killer":
            raise BrokenProcessPool
        return FolderResult(source, None, None)

    def pool(_dispatched: int) -> Any:
        return lambda tasks: (function(*arguments, **named) for function, arguments, named in tasks)

    @contextmanager
    def workers(*_: Any) -> Iterator[Any]:
        yield many._Workers(pool, 2, 4, (BrokenProcessPool,))

    monkeypatch.setattr(many, "_one", one)
    monkeypatch.setattr(many, "_workers", workers)
    sources = [EvidenceFolder(name, Path(name)) for name in ("a", "killer", "b", "c")]
    outcomes = {outcome.source.name: outcome.fault for outcome in many.diagnose_many(sources, 2)}
    assert outcomes.keys() == {"a", "killer", "b", "c"}
    code, line = outcomes.pop("killer") or ("", "")
    assert code == "PEER_DIED"
    assert line.startswith("killer: its worker process died (BrokenProcessPool)")
    assert set(outcomes.values()) == {None}
    assert tried.count("killer") == 2  # among the others, and alone
    assert tried.count("a") == 1  # it was done before
