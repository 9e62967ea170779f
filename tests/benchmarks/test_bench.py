"""The bench itself: its quick mode end to end, and contenders that fail in every way a program can."""

import importlib.util
import json
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_script import run_script

from palpate.core.errors import InputError
from palpate.ui.cli.commands.bench import text_of
from palpate.validate.bench.contender import PEERS, Contender, ContenderSpec, solve_with_fewest_steps
from palpate.validate.bench.environment import ours, ours_that_identifies, peer_python
from palpate.validate.bench.equilibrium import EquilibriumTable, scenes
from palpate.validate.bench.identification import identification
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.run import machine, run_bench
from palpate.validate.bench.scaling import fitted_exponent
from palpate.validate.bench.scene_file import BenchScene, write_scene

ELEMENTS = ("p1", "p2", "p2p1")


@pytest.fixture(scope="module")
def quick():
    told = []
    result = run_bench(BenchOptions(quick=True), lambda fraction, message: told.append((fraction, message)))
    return result, told


@pytest.mark.nightly
def test_quick_bench_is_a_json_object_with_every_part(quick):
    result, told = quick
    assert json.loads(json.dumps(result, allow_nan=False))["quick"] is True
    assert {"machine", "equilibrium", "skipped_peers", "scaling", "reduced_model", "workers", "identification"} <= set(
        result
    )
    fractions = [f for f, _ in told]
    assert fractions == sorted(fractions) and fractions[-1] <= 1.0


@pytest.mark.nightly
def test_quick_bench_solves_and_whoever_is_here_agrees(quick):
    (row,) = quick[0]["equilibrium"]
    assert row["palpate"]["reason"] == "" and row["palpate"]["seconds"] > 0.0
    assert row["palpate_certified"]["largest_difference_relative"] < 1e-6
    for name, peer in row["peers"].items():
        assert peer["reason"] != "" or peer["largest_difference_relative"] < 1e-5, name
    known = set(row["peers"]) | set(quick[0]["skipped_peers"])
    assert {"felupe", "scikit-fem", "calculix", "dolfinx"} <= known
    assert all(reason for reason in quick[0]["skipped_peers"].values())


@pytest.mark.nightly
def test_quick_bench_holds_what_is_promised_of_workers_and_of_the_reduced_model(quick):
    assert quick[0]["workers"]["same_bits"] is True
    reduced = quick[0]["reduced_model"]
    assert reduced["largest_error_percent"] <= 0.1 and reduced["evaluation_ms"] <= 1.0
    assert reduced["estimate_over_error_smallest"] >= 0.5


@pytest.mark.nightly
def test_quick_bench_fits_exponents(quick):
    p1 = quick[0]["scaling"]["elements"]["p1"]
    assert [r["cells"] for r in p1["rows"]] == sorted(r["cells"] for r in p1["rows"])
    assert 0.2 < p1["seconds_exponent"] < 2.5


def test_an_exponent_is_that_of_the_power_law():
    assert fitted_exponent([(n, 3.0 * n**1.37) for n in (1e3, 1e4, 1e5)]) == pytest.approx(1.37)
    assert fitted_exponent([(1.0, 1.0)]) is None


def test_full_bench_has_every_scene_of_the_done_list():
    chosen = scenes(BenchOptions())
    for cells in (4000, 20000):
        for ratio in (50.0, 200.0, 1000.0):
            assert BenchScene(cells, "p1", ratio, "traction") in chosen
    assert {s.element for s in chosen} == set(ELEMENTS)


@pytest.mark.parametrize("element", ELEMENTS)
def test_scene_file_says_the_same_scene_to_everyone(tmp_path, element):
    size = write_scene(BenchScene(300, element, 200.0, "traction"), tmp_path / "s.npz")
    with np.load(tmp_path / "s.npz", allow_pickle=False) as scene:
        assert scene["cells"].shape == (size.cells, 4 if element == "p1" else 10)
        assert np.abs(scene["force"].sum(axis=0)).max() < 1e-9 * np.abs(scene["force"]).sum()
        assert np.abs(scene["force"]).sum() > 0.0 and not scene["prescribed"].any()
        assert bool(scene["mixed"]) == (element == "p2p1")
        X = scene["nodes"][scene["cells"]]
        if element != "p1":
            mid = 0.5 * (X[:, [0, 1, 0, 0, 1, 2]] + X[:, [1, 2, 2, 3, 3, 3]])
            np.testing.assert_allclose(X[:, 4:], mid, atol=1e-12)
        bulk = scene["K"][scene["regions"] == 1]
        np.testing.assert_allclose(bulk / scene["G"][scene["regions"] == 1], 100.0)  # K / G = v1 / (2 mu)


def peer(tmp_path: Path, body: str) -> ContenderSpec:
    """A contender whose `solve(steps, rtol)` has this body; `scene` holds the file's arrays."""
    script = tmp_path / "peer.py"
    text = "import sys, time\nimport numpy as np\n"
    text += "from protocol import serve\ndef load(scene):\n    def solve(steps, rtol):\n"
    text += textwrap.indent(textwrap.dedent(body), " " * 8) + "\n    return solve\nserve(load, '1.0')\n"
    script.write_text(text)
    return ContenderSpec("peer", (sys.executable, str(script)), (), ELEMENTS)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.npz"
    write_scene(BenchScene(200, "p1"), path)
    return path


def first_answer(spec, scene, tmp_path, limit=20.0):
    contender = Contender.start(spec, scene, limit)
    try:
        return solve_with_fewest_steps(contender, 1e-8, tmp_path / "u.npy", (1, 2, 4)), contender
    finally:
        contender.stop()


def test_a_peer_that_needs_load_steps_gets_them_and_its_failures_stay_on_record(tmp_path, scene):
    body = """
    print("chatter on standard output")
    if steps < 4:
        raise ArithmeticError(f"inverted with {steps}")
    return np.zeros_like(scene["nodes"]), 7
    """
    answer, _ = first_answer(peer(tmp_path, body), scene, tmp_path)
    assert answer["reason"] == "" and answer["load_steps"] == 4 and answer["iterations"] == 7
    assert [f["reason"] for f in answer["failures"]] == ["inverted with 1", "inverted with 2"]


def test_a_peer_that_never_arrives_is_a_reason(tmp_path, scene):
    answer, _ = first_answer(peer(tmp_path, "raise ValueError('singular')"), scene, tmp_path)
    assert answer["reason"] == "singular" and len(answer["failures"]) == 3


def test_a_peer_without_a_finite_solution_has_failed(tmp_path, scene):
    answer, _ = first_answer(peer(tmp_path, "return np.nan * scene['nodes'], 1"), scene, tmp_path)
    assert answer["reason"] == "the solution is not finite"


def test_a_peer_that_hangs_is_stopped_and_one_that_dies_is_noticed(tmp_path, scene):
    answer, contender = first_answer(peer(tmp_path, "time.sleep(60)"), scene, tmp_path, limit=1.5)
    assert answer["reason"] == "no answer within 1.5 s"
    assert contender.process.poll() is not None
    answer, _ = first_answer(peer(tmp_path, "print('disk full'); import os; os._exit(3)"), scene, tmp_path)
    assert answer["reason"] == "the child process has ended with status 3: disk full"
    answer, _ = first_answer(peer(tmp_path, "import os; os.kill(os.getpid(), 9)"), scene, tmp_path)
    assert answer["reason"] == "the child process has ended, killed by signal 9 (out of memory?): it wrote no message"


def test_table_keeps_a_wrong_and_a_failing_peer_apart_from_a_right_one(tmp_path, scene):
    wrong = peer(tmp_path, "return np.ones_like(scene['nodes']), 1")
    table = EquilibriumTable([wrong], BenchOptions(quick=True).effective(), tmp_path)
    row = table.row(BenchScene(200, "p1"))
    assert row["peers"]["peer"]["largest_difference_relative"] > 0.1
    assert row["fastest_peer"] is None, "who is wrong is not compared"
    assert row["palpate"]["seconds"] > 0.0


def test_a_peer_that_dies_on_its_first_scene_is_an_error_and_later_a_reason(tmp_path):
    table = EquilibriumTable(
        [peer(tmp_path, "if len(scene['nodes']) > 200: import nowhere\nreturn scene['prescribed'], 1")],
        BenchOptions(quick=True, repeats=1).effective(),
        tmp_path,
    )
    with pytest.raises(
        InputError, match=r"peer did not run: .* with status 1: ModuleNotFoundError: No module named 'nowhere'"
    ):
        table.row(BenchScene(1500, "p1"))
    assert table.row(BenchScene(200, "p1"))["peers"]["peer"]["reason"] == ""
    assert "nowhere" in table.row(BenchScene(1500, "p1"))["peers"]["peer"]["reason"]


def test_a_peer_asked_for_by_name_has_to_take_part(tmp_path):
    with pytest.raises(InputError, match="felupe was asked for and is not here: its environment is not in "):
        run_bench(BenchOptions(quick=True, parts=("equilibrium",), peers=("felupe",), peers_dir=tmp_path))
    with pytest.raises(
        InputError, match="felupe: peers are compared in the parts equilibrium and identification alone"
    ):
        run_bench(BenchOptions(quick=True, parts=("scaling",), peers=("felupe",)))


def test_a_peer_without_the_element_asked_for_has_to_be_told(tmp_path):
    peers_environment(tmp_path)
    options = BenchOptions(parts=("equilibrium",), elements=("p2p1",), peers=("felupe",), peers_dir=tmp_path)
    with pytest.raises(InputError, match="felupe was asked for and has no element p2p1; choose --element p1"):
        run_bench(options)


def peers_environment(folder: Path) -> None:
    """This very environment in the form of the peers' own: it has scikit-fem, and not FElupe."""
    (folder / "bin").mkdir()
    (folder / "bin" / "python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    (folder / "bin" / "python").chmod(0o755)
    (folder / "complete").touch()


def bench_through_run(folder: Path, name: str):
    peers_environment(folder)
    return run_script("palpate", "bench", "--quick", "--json", "--part", "equilibrium", "--repeats", "1",
                      "--peer", name, "--peers-dir", str(folder))  # fmt: skip


@pytest.mark.nightly
def test_peers_are_compared_through_run(tmp_path):
    pytest.importorskip("pypardiso", reason="scikit-fem with pardiso needs an x86 processor")
    done = bench_through_run(tmp_path, "scikit-fem")
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)["equilibrium"]
    assert {name: peer["reason"] for name, peer in row["peers"].items()} == {
        "scikit-fem": "", "scikit-fem with pardiso": "",
    }  # fmt: skip


@pytest.mark.nightly
def test_a_peer_that_cannot_start_ends_the_bench_through_run_with_its_own_last_line(tmp_path):
    if importlib.util.find_spec("felupe"):
        pytest.skip("FElupe is installed here; the test needs a peer that is not")
    done = bench_through_run(tmp_path, "felupe")
    assert done.returncode == 3
    told = json.loads(done.stdout)["error"]
    assert told.startswith("felupe did not run: ") and "ModuleNotFoundError: No module named 'felupe'" in told


def test_a_peer_knows_nothing_of_palpate():
    """It runs in an environment that has no Palpate, and may be of another licence."""
    for script in [*PEERS.glob("*_peer.py"), PEERS / "felupe_identify.py"]:
        assert "palpate." not in script.read_text().replace("palpate-ccx", ""), script
    assert "import palpate" not in (PEERS / "protocol.py").read_text()


def test_identification_is_compared_where_the_optimum_is_the_same(tmp_path):
    """Palpate beside itself under another name, and beside a loop that ends elsewhere and one that cannot run."""
    again = replace(ours_that_identifies(), name="again")
    elsewhere = replace(peer(tmp_path, "return np.log(np.array([30.0, 30.0])), 2"), name="elsewhere")
    broken = ContenderSpec("broken", (sys.executable, "-c", "import nowhere"))
    found = identification([again, elsewhere, broken], BenchOptions(repeats=1), tmp_path, lambda *_: None)
    own, peers = found["palpate"], found["peers"]
    np.testing.assert_allclose(np.exp(own["ln_G"]), [20.0, 60.0], rtol=0.05)
    assert peers["again"]["ln_G"] == own["ln_G"] and peers["again"]["equilibria"] == own["equilibria"] <= 6
    assert found["times_faster_than_fastest_peer"] == peers["again"]["times_our_seconds"]
    assert "times_our_seconds" in peers["elsewhere"]
    assert "nowhere" in peers["broken"]["reason"]
    table = {"machine": {**machine(), "load_before": (0, 0, 0), "load_after": (0, 0, 0)}, "identification": found}
    told = "\n".join(text_of(table))
    assert "again" in told and "failed: " in told and f"{own['equilibria']} equilibria" in told


def test_a_peer_that_was_asked_for_has_to_identify(tmp_path):
    def asked(*peers):
        return BenchOptions(quick=True, parts=("identification",), peers=peers, peers_dir=tmp_path / "peers")

    with pytest.raises(InputError, match="calculix was asked for and has no loop that identifies; choose felupe"):
        run_bench(asked("calculix"))
    with pytest.raises(InputError, match="felupe was asked for and is not here: its environment is not in "):
        run_bench(asked("felupe"))
    (tmp_path / "peers").mkdir()
    peers_environment(tmp_path / "peers")
    if importlib.util.find_spec("felupe") is None:
        with pytest.raises(InputError, match=r"least squares did not run: .*No module named 'felupe'"):
            run_bench(asked("felupe"))


def test_ours_fails_with_a_reason_too(tmp_path, scene):
    with np.load(scene) as data:
        arrays = dict(data)
    arrays["prescribed"] = arrays["prescribed"] * 30.0  # turns the cube inside out
    np.savez(scene, **arrays)
    answer, _ = first_answer(ours(), scene, tmp_path)
    assert "% of the load" in answer["reason"]


def test_no_environment_for_peers_is_a_reason(tmp_path):
    (tmp_path / "file").write_text("")
    python, reason = peer_python(tmp_path / "file" / "environment")
    assert python is None and "could not be made" in reason
    python, reason = peer_python(tmp_path / "absent", may_install=False)
    assert python is None and "is not in" in reason
    assert not (tmp_path / "absent").exists()


def test_calculix_deck_keeps_to_twenty_characters_and_its_table_is_read_back(tmp_path, scene, monkeypatch):
    monkeypatch.syspath_prepend(str(PEERS))
    monkeypatch.delitem(sys.modules, "protocol", raising=False)
    import calculix_peer

    write_scene(BenchScene(200, "p2", 1000.0, "traction"), scene)
    with np.load(scene) as data:
        deck = calculix_peer.deck(dict(data), 1e-8, True)
    fields = [f for line in deck.splitlines() if not line.startswith("*") for f in line.split(",")]
    assert max(map(len, fields)) <= 20  # what CalculiX reads of a number
    text = " displacements (vx,vy,vz) for set NALL and time  0.1000000E+01\n\n"
    text += "         2  1.0E+00 -2.0E-01  3.0E+00\n         1  4.0E+00  5.0E+00  6.0E+00\n"
    np.testing.assert_array_equal(calculix_peer.displacements(text, 2), [[4, 5, 6], [1, -0.2, 3]])


def test_a_bench_of_one_part_measures_that_part_alone():
    options = BenchOptions(quick=True, parts=("scaling",))
    result = run_bench(options)
    assert set(result) == {"machine", "quick", "rtol", "scaling"}
    rows = result["scaling"]["elements"]["p1"]["rows"]
    assert all(r["cpu_seconds"] > 0.0 and r["memory_mb"] > 0.0 for r in rows)
    assert any("exponents" in line for line in text_of(result))
