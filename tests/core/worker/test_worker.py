"""The worker process: its messages, its end, and what it leaves."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from palpate.core.errors import Cancelled, PalpateError
from palpate.core.worker.job import Job
from palpate.core.worker.process import run_job

KIND = "palpate.core.worker.selfcheck:run"
linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc to see processes")


def job(folder, workers=1, kind=KIND, **options):
    return Job(kind, str(folder), options={"iterations": 12, **options}, seed=3, workers=workers)


def processes_of(session: int) -> list[int]:
    """Process ids whose session is the given one; a worker and its pool are a session of their own."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            after_name = entry.read_text().rpartition(")")[2].split()
        except OSError:  # it ended while we looked
            continue
        if int(after_name[3]) == session and after_name[0] not in "ZX":
            found.append(int(entry.parent.name))
    return found


def wait_until_gone(session: int, seconds: float) -> float:
    start = time.monotonic()
    while processes_of(session) and time.monotonic() - start < seconds:
        time.sleep(0.01)
    assert processes_of(session) == []
    return time.monotonic() - start


def test_messages_arrive_in_order_while_the_job_runs(tmp_path):
    seen, times = [], []
    result = run_job(job(tmp_path, pause_s=0.001), lambda m: (seen.append(m), times.append(time.monotonic())))
    assert seen[0]["type"] == "started"
    assert seen[-1] == {"type": "result", "result": result}
    progress = [m for m in seen if m["type"] == "progress"]
    assert [m["iteration"] for m in progress] == list(range(1, 13))
    assert progress[-1]["fraction"] == 1.0
    assert np.shape(progress[0]["particles"]) == (40, 2)
    assert times[-1] - times[1] > 11 * 40 * 0.001
    kept = [json.loads(line) for line in (tmp_path / "messages.jsonl").read_text().splitlines()]
    assert kept == seen


def test_any_number_of_workers_gives_the_same_result(tmp_path):
    assert run_job(job(tmp_path / "1", 1)) == run_job(job(tmp_path / "2", 2))


def test_a_second_run_goes_on_from_the_checkpoint_and_another_job_does_not(tmp_path):
    first, again, other = [], [], []
    result = run_job(job(tmp_path), first.append)
    assert run_job(job(tmp_path, workers=2), again.append) == result
    assert [m["type"] for m in again] == ["started", "result"]
    run_job(job(tmp_path, accept=2.0), other.append)
    assert len(other) == len(first)


@linux
def test_killed_at_any_iteration_a_rerun_ends_at_the_same_result(tmp_path):
    whole = run_job(job(tmp_path / "whole", 2))
    pid = []

    def kill_at_five(message):
        if message["type"] == "started":
            pid.append(message["process"])
        if message.get("iteration") == 5:
            os.kill(pid[0], signal.SIGKILL)

    with pytest.raises(PalpateError, match=r"died \(signal 9\).*run the command again"):
        run_job(job(tmp_path / "killed", 2, pause_s=0.001), kill_at_five)
    assert processes_of(pid[0]) == []
    assert (tmp_path / "killed/checkpoint.npz").exists()
    assert list((tmp_path / "killed").glob(".part-*")) == []
    steps = []
    resumed = run_job(job(tmp_path / "killed", 1, pause_s=0.001), lambda m: steps.append(m.get("iteration")))
    assert resumed == whole
    assert min(i for i in steps if i is not None) > 5


# ---- its end


@linux
@pytest.mark.parametrize("workers", [1, 2])
def test_cancel_ends_everything_within_a_second(tmp_path, workers):
    cancel, pid, asked = threading.Event(), [], []

    def cancel_at_first_progress(message):
        if message["type"] == "started":
            pid.append(message["process"])
        if message["type"] == "progress" and not asked:
            asked.append(time.monotonic())
            cancel.set()

    with pytest.raises(Cancelled, match="stopped as asked"):
        run_job(job(tmp_path, workers, iterations=10_000, pause_s=0.005), cancel_at_first_progress, cancel)
    assert time.monotonic() - asked[0] < 1.0
    assert processes_of(pid[0]) == []
    assert "cancelled" in (tmp_path / "messages.jsonl").read_text().splitlines()[-1]


@linux
def test_cancel_while_the_pool_starts_leaves_nothing(tmp_path):
    cancel, pid = threading.Event(), []
    with pytest.raises(Cancelled, match="stopped as asked"):
        run_job(job(tmp_path, 2), lambda m: (pid.append(m.get("process")), cancel.set()), cancel)
    assert processes_of(pid[0]) == []


@linux
def test_terminated_from_outside_it_says_cancelled(tmp_path):
    def terminate(message):
        if message["type"] == "progress":
            os.kill(pid[0], signal.SIGTERM)
        elif message["type"] == "started":
            pid.append(message["process"])

    pid: list[int] = []
    with pytest.raises(Cancelled, match="stopped from outside"):
        run_job(job(tmp_path, 2, iterations=10_000, pause_s=0.005), terminate)
    assert processes_of(pid[0]) == []


@linux
def test_a_process_that_does_not_listen_is_killed_within_a_second(tmp_path):
    """A stand-in for an interpreter that hangs: it ignores its input and SIGTERM, and has a child that does too."""
    deaf = tmp_path / "deaf"
    deaf.write_text(
        "#!/bin/sh\ntrap '' TERM\necho not a message\n"
        r'echo "{\"type\": \"started\", \"process\": $$}"'
        "\nsleep 60 & sleep 60\n"
    )
    deaf.chmod(0o755)
    cancel, seen = threading.Event(), []
    with pytest.raises(Cancelled, match="stopped as asked"):
        run_job(job(tmp_path), lambda m: (seen.append((m, time.monotonic())), cancel.set()), cancel, python=str(deaf))
    message, at = seen[0]
    assert message["type"] == "started"
    assert time.monotonic() - at < 1.0
    assert processes_of(message["process"]) == []


@linux
def test_an_exception_of_the_listener_leaves_nothing(tmp_path):
    pid = []

    def fail(message):
        pid.append(message["process"])
        raise KeyboardInterrupt("stop")

    with pytest.raises(KeyboardInterrupt, match="stop"):
        run_job(job(tmp_path, 2, iterations=10_000), fail)
    assert processes_of(pid[0]) == []


@linux
def test_when_the_parent_is_killed_worker_and_pool_end_too(tmp_path):
    script = (
        "import sys\nfrom palpate.core.worker.job import Job\nfrom palpate.core.worker.process import run_job\n"
        "def tell(m):\n    print(m['type'], m.get('process'), flush=True)\n"
        "if __name__ == '__main__':\n    run_job(Job.load(__import__('pathlib').Path(sys.argv[1])), tell)\n"
    )
    (tmp_path / "parent.py").write_text(script)
    job(tmp_path / "job", 2, iterations=10_000, pause_s=0.005).save(tmp_path / "job.json")
    parent = subprocess.Popen(
        [sys.executable, str(tmp_path / "parent.py"), str(tmp_path / "job.json")], stdout=subprocess.PIPE, text=True
    )
    with parent, parent.stdout:
        worker = int(parent.stdout.readline().split()[1])
        while not parent.stdout.readline().startswith("progress"):
            pass
        assert len(processes_of(worker)) >= 3
        parent.kill()
    wait_until_gone(worker, 2.0)
