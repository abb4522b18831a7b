"""Linear algebra has one thread, or a diagnosis depends on how many cores there are."""

import numpy as np  # noqa: F401  # threadpoolctl finds only loaded libraries
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from diagnosis import diagnose
from diagnosis.processes import each, spread
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow


class _SeenError(Exception):
    pass


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def seen(_shared: None, wanted: int) -> set[int]:
    assert wanted == 0
    return threads()


def test_a_diagnosis_has_one_thread_wherever_it_works(monkeypatch):
    def stop(*_):
        raise _SeenError(threads())

    monkeypatch.setattr(diagnose, "before_fits", stop)
    with threadpool_limits(limits=2):
        assert threads() == {2}
        with pytest.raises(_SeenError, match=r"\{1\}"):
            diagnose.diagnose(None, lambda _text, _share: None)  # pyright: ignore[reportArgumentType]
        assert threads() == {2}


def test_so_have_its_workers(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "2")
    assert each(2, seen, None, [0, 0]) == [{1}, {1}]


@pytest.mark.parametrize("jobs", [1, 3])
def test_spread_work_keeps_the_order_of_its_items(jobs):
    assert spread(jobs, _doubled, 2, range(7)) == [0, 2, 4, 6, 8, 10, 12]
    assert spread(jobs, _doubled, 2, []) == []


def _doubled(factor, items):
    return [factor * item for item in items]


@pytest.mark.timeout(PATIENCE_S)
def test_a_worker_that_stops_is_replaced():
    """joblib warns of it in a thread that an error would end; `filterwarnings` in pyproject.toml lets that one pass."""

    def grows(_shared: None, item: int) -> int:
        from joblib.externals.loky import process_executor

        process_executor._MEMORY_LEAK_CHECK_DELAY = -1.0
        process_executor._MAX_MEMORY_LEAK_SIZE = -(1 << 50)
        return item

    assert each(2, grows, None, range(12)) == list(range(12))
