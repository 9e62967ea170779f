"""The worker's parts, and what goes wrong in a job: refusals, messages, checkpoints, executors."""

import importlib
import os
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from palpate.core.errors import ConvergenceError, InputError, PalpateError
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.executors import make_executor
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter, decode, encode
from palpate.core.worker.process import run_job

KIND = "palpate.core.worker.selfcheck:run"
linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc to see processes")


def job(folder, workers=1, kind=KIND, **options):
    return Job(kind, str(folder), options={"iterations": 12, **options}, seed=3, workers=workers)


def test_numerical_failure_is_raised_as_such(tmp_path):
    with pytest.raises(ConvergenceError, match="the swarm stopped at"):
        run_job(job(tmp_path, accept=-1.0))


def test_our_own_mistake_is_one_line_and_a_traceback_in_the_folder(tmp_path):
    seen = []
    with pytest.raises(
        PalpateError, match=r"internal error \(TypeError in selfcheck\.py:\d+\); the details are in"
    ) as caught:
        run_job(job(tmp_path, kind="palpate.core.worker.selfcheck:rastrigin"), seen.append)
    assert "\n" not in str(caught.value)
    assert "between instances" not in str(caught.value)
    assert caught.value.exit_code == 1
    assert "between instances" in (tmp_path / "traceback.txt").read_text()
    assert seen[-1]["type"] == "failed"


def test_unknown_kinds_and_names_outside_the_package_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"no job kind 'palpate\.core\.worker\.nothing:run'"):
        run_job(job(tmp_path, kind="palpate.core.worker.nothing:run"))
    with pytest.raises(InputError, match="no job kind"):
        run_job(job(tmp_path, kind="palpate.core.worker.selfcheck:nothing"))
    for kind in ("os:system", "palpate_evil.x:run", "palpate:run", "palpate.core.worker.selfcheck:run.__globals__"):
        with pytest.raises(InputError, match="is not of the form"):
            Job(kind, str(tmp_path))


def test_a_missing_input_names_the_file(tmp_path):
    with pytest.raises(InputError, match=r"problem\.npz: cannot be read"):
        run_job(Job(KIND, str(tmp_path), paths={"problem": str(tmp_path / "problem.npz")}))


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        run_job(job(tmp_path / "file" / "identify"))


def test_a_file_that_is_no_job_is_refused(tmp_path):
    for text in ("", "[]", '{"format": 1}', '{"format": 9, "kind": "palpate.a:b", "folder": "."}'):
        (tmp_path / "job.json").write_text(text)
        with pytest.raises(InputError, match=r"job\.json"):
            Job.load(tmp_path / "job.json")


def test_job_round_trip_and_fingerprint(tmp_path):
    (tmp_path / "a").write_bytes(b"1")
    first = Job(KIND, str(tmp_path), {"a": str(tmp_path / "a")}, {"x": [1, 2.5]}, seed=4, workers=2)
    first.save(tmp_path / "job.json")
    assert Job.load(tmp_path / "job.json") == first
    fewer = Job(KIND, "elsewhere", first.paths, first.options, seed=4, workers=1)
    assert fewer.fingerprint() == first.fingerprint()
    (tmp_path / "a").write_bytes(b"2")
    assert fewer.fingerprint() != Job(KIND, "", {}, first.options, seed=4).fingerprint()
    assert Job(KIND, "", seed=1).fingerprint() != Job(KIND, "", seed=2).fingerprint()


def test_messages_are_strict_json_on_one_line():
    line = encode(
        {"type": "progress", "best": np.inf, "x": np.array([[1.0, np.nan]]), "n": np.int64(3), "path": Path("a\nb")}
    )
    assert "\n" not in line
    assert decode(line) == {"type": "progress", "best": None, "x": [[1.0, None]], "n": 3, "path": "a\nb"}
    for noise in ("", "Intel MKL WARNING", "[1]", '{"type": "other"}', b"\xff\xfe"):
        assert decode(noise) is None


def test_reporter_is_a_progress_and_keeps_the_fraction_in_range():
    sent = []
    Reporter(sent.append).progress(1.0000001, "almost done", best=2.0)
    assert sent == [{"type": "progress", "fraction": 1.0, "message": "almost done", "best": 2.0}]


def test_checkpoints_belong_to_one_job_and_are_whole_or_absent(tmp_path):
    path = tmp_path / "deep" / "checkpoint.npz"
    assert load_checkpoint(path, "a") is None
    save_checkpoint(path, {"x": np.arange(3.0)}, "a")
    np.testing.assert_array_equal(load_checkpoint(path, "a")["x"], [0, 1, 2])
    assert load_checkpoint(path, "b") is None
    with pytest.raises(TypeError, match="no objects"):
        save_checkpoint(path, {"x": np.array([{}])}, "a")
    np.testing.assert_array_equal(load_checkpoint(path, "a")["x"], [0, 1, 2])
    assert [p.name for p in path.parent.iterdir()] == ["checkpoint.npz"]
    path.write_bytes(path.read_bytes()[:-30])
    assert load_checkpoint(path, "a") is None


def test_one_worker_is_this_process_and_computes_when_asked():
    calls = []
    with make_executor(1, calls.append, ("ready",)) as executor:
        results = executor.map(calls.append, [1, 2])
        assert calls == ["ready"]
        next(results)
        assert calls == ["ready", 1]
        assert executor.submit(os.getpid).result() == os.getpid()


def test_pool_keeps_order_and_every_process_one_thread():
    with make_executor(2, importlib.import_module, ("numpy",)) as executor:
        assert list(executor.map(abs, range(-20, 0))) == list(range(20, 0, -1))
        pools = executor.submit(threadpool_info).result()
        assert executor.submit(os.getpid).result() != os.getpid()
    assert pools
    assert {p["num_threads"] for p in pools} == {1}


def test_keys_that_nobody_declared_are_refused(tmp_path: Path) -> None:
    """A misspelt option would otherwise be passed over, and its default be used without a word."""
    with pytest.raises(InputError, match=r"itterations is unknown; allowed are .*iterations"):
        run_job(job(tmp_path, itterations=3))
    path = tmp_path / "job.json"
    job(tmp_path).save(path)
    path.write_text(path.read_text().replace('"workers"', '"worker"'))
    with pytest.raises(InputError, match="worker is unknown"):
        Job.load(path)
