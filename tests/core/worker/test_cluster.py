"""The door to a Dask cluster. The cluster itself is not part of the tests: a stand-in with its interface is."""

from __future__ import annotations

import sys
from concurrent.futures import Executor
from types import ModuleType
from typing import Any

import pytest

from palpate.core.errors import InputError
from palpate.core.worker.cluster import study_executor
from palpate.core.worker.executors import SerialExecutor
from palpate.validate.forward.robustness import RobustnessOptions, robustness


class Counting(SerialExecutor):
    """Stands for a cluster: counts what it is given."""

    calls = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        Counting.calls += 1
        return super().submit(fn, *args, **kwargs)

    def map(self, fn: Any, *iterables: Any, timeout: Any = None, chunksize: int = 1) -> Any:
        return (self.submit(fn, *args).result() for args in zip(*iterables, strict=True))


class Client:
    """Stands for distributed.Client."""

    def __init__(self, address: str, timeout: float) -> None:
        if address != "tcp://here:8786":
            raise OSError("timed out")

    def get_executor(self, pure: bool) -> Executor:
        assert not pure
        return Counting()


@pytest.fixture
def dask(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("distributed")
    module.Client = Client  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "distributed", module)


def test_without_dask_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="--cluster needs Dask, which is not installed"):
        study_executor(1, "tcp://here:8786")


def test_an_address_that_does_not_answer_is_named(dask: None) -> None:
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://there:1 \(timed out\)"):
        study_executor(1, "tcp://there:1")


def test_a_study_on_a_cluster_ends_as_at_home(dask: None) -> None:
    here = robustness(RobustnessOptions(2))
    Counting.calls = 0
    there = robustness(RobustnessOptions(2, cluster="tcp://here:8786"))
    assert Counting.calls > 0
    for key in ("scenes", "share_converged", "mean_factorisations", "strain95_median_and_largest"):
        assert here[key] == there[key]


def test_without_an_address_the_work_stays_here() -> None:
    with study_executor(1) as executor:
        assert isinstance(executor, SerialExecutor)
