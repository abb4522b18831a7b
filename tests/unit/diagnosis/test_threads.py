"""Linear algebra has one thread, or a diagnosis depends on how many cores there are."""

import numpy as np  # noqa: F401  # threadpoolctl finds only loaded libraries
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from diagnosis import diagnose
from diagnosis.threads import each


class _SeenError(Exception):
    pass


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_a_diagnosis_has_one_thread_wherever_it_works(monkeypatch):
    def stop(*_):
        raise _SeenError(*each(2, lambda _: threads(), range(2)))

    monkeypatch.setattr(diagnose, "before_fits", stop)
    with threadpool_limits(limits=2):
        assert threads() == {2}
        with pytest.raises(_SeenError) as seen:
            diagnose.diagnose(None, lambda _text, _share: None)  # pyright: ignore[reportArgumentType]
        assert seen.value.args == ({1}, {1})
        assert threads() == {2}
