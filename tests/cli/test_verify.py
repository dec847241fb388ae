"""`verify`: metrics alone, from specifications, metric files and coefficients of other tools."""

import io
import json
import zipfile
from functools import partial

import commands
import numpy as np
import pytest
from scipy.io import savemat

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError
from tubecert.model import build
from tubecert.pipeline.verification import verify
from tubecert.spec import load
from tubecert.synthesis.coefficients import with_metric_file
from tubecert.verdict import Verdict

SYSTEM = """
tubecert: 1
name: oblique
system: {states: [x1, x2], inputs: [u], f: ["-x1 + 2*x2", "-0.25*x2**3 - 3*x1 + 4*x2"], B: [["0.5"], [-2]]}
safe_set: {x1: [-5, 5], x2: [-5, 5]}
"""
OWN = 'metric: {rate: 1.74, dual_metric: [["4.25828", "-0.93423"], ["-0.93423", "3.76692"]]}\n'
W = [[4.25828, -0.93423], [-0.93423, 3.76692]]
# x' = -x + y, y' = u: W = [[1 + x**2/4 ...]] with a monomial in x, which no input moves
BENT = """
tubecert: 1
name: bent
system: {states: [x, y], inputs: [u], parameters: {k: 0.5}, f: ["-x + y", "0"], B: [[0], [1]]}
safe_set: {x: [-0.5, 0.5], y: [-0.5, 0.5]}
"""
ONE, SQUARE = [[1, -0.5], [-0.5, 2]], [[0.25, 0], [0, 0.125]]


run = partial(commands.run, "verify", "--no-progress", catch_exceptions=False)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "system.yaml").write_text(SYSTEM)
    (tmp_path / "own.yaml").write_text(SYSTEM + OWN)
    (tmp_path / "bent.yaml").write_text(BENT)
    return tmp_path


def test_a_metric_without_plan_uncertainty_or_tube(folder):
    """The largest rate is that of the closed form: one direction is left, at the worst x2 of a box."""
    done = run(folder / "own.yaml", "--json")
    assert done.exit_code == 0
    (found,) = json.loads(done.stdout)
    assert found["verdict"] == "certified"
    low, high = found["largest_rate"]
    v = np.array([2.0, 0.5])  # B'v = 0
    slopes = [np.array([[-1, 2], [-3, 4 - 0.75 * s]]) for s in np.linspace(0, 25, 2001)]
    true = min(-(v @ A @ np.array(W) @ v) / (v @ np.array(W) @ v) for A in slopes)
    assert low <= true <= high
    assert high - low <= 1e-3 * high
    eigenvalues = np.linalg.eigvalsh(W)
    assert found["condition_number"][0] <= eigenvalues[1] / eigenvalues[0] <= found["condition_number"][1]


def test_many_files_and_the_worst_exit_code(folder):
    (folder / "fast.yaml").write_text(SYSTEM + OWN.replace("1.74", "1.9"))
    done = run(folder / "own.yaml", folder / "fast.yaml")
    assert done.exit_code == 1
    words = " ".join(done.stdout.split())
    assert "the largest rate that this metric supports is 1.74" in words
    assert "2 metrics: 1 certified, 1 refuted" in words
    assert run(folder / "fast.yaml", "--rate", "1.7").exit_code == 0


def test_verdicts_are_told_one_after_the_other(folder, monkeypatch):
    """What is decided is known when the next one takes for ever."""
    from tubecert.pipeline import verification

    honest, calls = verification.verify, []

    def endless(spec, effort, progress):
        calls.append(spec)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return honest(spec, effort, progress)

    monkeypatch.setattr(verification, "verify", endless)
    done = run(folder / "own.yaml", folder / "own.yaml")
    assert done.exit_code == 130
    assert done.stdout.startswith("certified")


def test_what_cannot_be_decided_is_undecided(folder):
    edge = run(folder / "bent.yaml", _json(folder, {"coefficients": ONE, "rate": 1}), "--rate", "1.5")
    assert edge.exit_code == 4  # v = (1, 0): -1 - 0.5 = -1.5 exactly
    assert "undecided" in edge.stdout


def test_a_metric_that_is_not_positive_or_depends_on_the_wrong_state(folder):
    done = run(folder / "bent.yaml", _json(folder, {"coefficients": [[1, 2], [2, 1]], "rate": 1}))
    assert done.exit_code == 1
    assert "not positive definite" in " ".join(done.stdout.split())  # wherever a long path breaks the line
    moved = {"coefficients": [ONE, SQUARE], "monomials": ["1", "y**2"], "rate": 1}
    done = run(folder / "bent.yaml", _json(folder, moved), "--json")
    assert done.exit_code == 1
    (found,) = json.loads(done.stdout)
    assert found["reason"]["claim"] == "metric_killing"
    assert found["largest_rate"][0] > 1.4  # of C2, which is decided all the same


@pytest.mark.slow
def test_a_rank_that_is_lost_is_said(folder):
    (folder / "own.yaml").write_text((SYSTEM + OWN).replace('[["0.5"], [-2]]', '[["x1"], [0]]'))
    done = run(folder / "own.yaml", "--budget", "300")
    assert done.exit_code == 1
    assert "rank" in done.stdout


def test_a_certified_metric_is_written_and_read_again(folder):
    target = folder / "m.json"
    given = _json(folder, {"coefficients": W, "rate": 1.74})
    assert run(folder / "system.yaml", given, "-o", target).exit_code == 0
    content = json.loads(target.read_text())
    assert content["dual_metric"] == [["4.25828", "-0.93423"], ["-0.93423", "3.76692"]]
    assert run(folder / "system.yaml", target).exit_code == 0
    target.unlink()
    assert run(folder / "system.yaml", given, "--rate", "1.9", "-o", target).exit_code == 1
    assert not target.exists()
    assert run(folder / "own.yaml", folder / "own.yaml", "-o", target).exit_code == 2
    assert run(folder / "own.yaml", "-o", folder / "own.yaml").exit_code == 2


def test_what_is_missing_is_said(folder):
    assert run(folder / "system.yaml").exit_code == 2
    assert run(_json(folder, {"coefficients": W, "rate": 1})).exit_code == 2
    (folder / "own.yaml").write_text(OWN)
    assert run(folder / "own.yaml").exit_code == 2


def _json(folder, content, name="given.json"):
    (folder / name).write_text(json.dumps(content))
    return folder / name


def _csv(folder, matrices, monomials):
    lines = ["monomial,row,column,value"]
    for matrix, monomial in zip(matrices, monomials, strict=True):
        lines += [f"{monomial},{i + 1},{j + 1},{matrix[i][j]}" for i in range(2) for j in range(i, 2)]
    (folder / "given.csv").write_text("\n".join(lines) + "\n")
    return folder / "given.csv"


def _npz(folder, **arrays):
    np.savez(folder / "given.npz", **arrays)
    return folder / "given.npz"


def _mat(folder, **arrays):
    savemat(folder / "given.mat", arrays)
    return folder / "given.mat"


LAST = np.moveaxis(np.array([ONE, SQUARE]), 0, -1)
WRITERS = {
    "json": lambda f: _json(f, {"coefficients": [ONE, SQUARE], "monomials": ["1", "x**2"], "rate": "1"}),
    "json powers": lambda f: _json(f, {"coefficients": [ONE, SQUARE], "powers": [[0, 0], [2, 0]], "rate": 1}),
    "csv": lambda f: _csv(f, [ONE, SQUARE], ["1", "x**2"]),
    "npz": lambda f: _npz(f, coefficients=[ONE, SQUARE], monomials=["1", "x**2"], rate=1.0),
    "npz powers": lambda f: _npz(f, coefficients=[ONE, SQUARE], powers=[[0, 0], [2, 0]]),
    "mat": lambda f: _mat(f, coefficients=LAST, monomials=np.array(["1", "x**2"], dtype=object), rate=1.0),
    "mat powers": lambda f: _mat(f, coefficients=LAST, powers=[[0, 0], [2, 0]]),
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_is_the_same_metric(folder, name):
    spec = load(str(folder / "bent.yaml"), reads="system")
    W = [["1 + 0.25*x**2", "-0.5"], ["-0.5", "2 + 0.125*x**2"]]
    written = {"format": "tubecert-metric/1", "rate": 1, "dual_metric": W}
    reference = with_metric_file(spec, str(_json(folder, written, "reference.json")))
    path = WRITERS[name](folder)
    found = with_metric_file(spec, str(path), None if "rate" in path.read_text("latin-1") else 1)
    assert build(found).W == build(reference).W
    assert found.metric.rate == 1
    assert verify(found, Effort()).verdict is Verdict.CERTIFIED


def test_floats_are_their_shortest_decimals_and_texts_are_exact(folder):
    spec = load(str(folder / "bent.yaml"), reads="system")
    third = _json(folder, {"coefficients": [["1/3", "0"], ["0", 1]], "rate": 0.1})
    metric = with_metric_file(spec, str(third)).metric
    assert str(metric.dual_metric[0][0].expression.fraction) == "1/3"
    array = _npz(folder, coefficients=np.array([[0.1, 0.0], [0.0, 1.0]]), rate=0.1)
    assert str(with_metric_file(spec, str(array)).metric.dual_metric[0][0].expression.fraction) == "1/10"


def test_a_csv_of_numbers_alone_is_a_constant_dual_metric(folder):
    spec = load(str(folder / "bent.yaml"), reads="system")
    found = with_metric_file(spec, str(_text(folder, "rows.csv", "1e0, -0.5\n-0.5,2\n")), 1)
    rows = [[str(e.expression.fraction) for e in row] for row in found.metric.dual_metric]
    assert rows == [["1", "-1/2"], ["-1/2", "2"]]
    with pytest.raises(SpecError, match="not symmetric"):
        with_metric_file(spec, str(_text(folder, "rows.csv", "1,0.5\n-0.5,2\n")), 1)


def test_an_asymmetry_of_rounding_is_mended_and_no_other(folder):
    spec = load(str(folder / "bent.yaml"), reads="system")
    array = np.array([[1.0, -0.5], [-0.5 + 1e-15, 2.0]])
    W = with_metric_file(spec, str(_npz(folder, coefficients=array, rate=1.0))).metric.dual_metric
    assert W[0][1].expression is W[1][0].expression
    skew = array + np.array([[0, 0], [1e-6, 0]])
    with pytest.raises(SpecError, match="not symmetric"):
        with_metric_file(spec, str(_npz(folder, coefficients=skew, rate=1.0)))


class Bomb:
    def __reduce__(self):
        return (print, ("run",))


def _bad(folder):
    good = {"coefficients": W, "rate": 1}
    for why, content in {
        "no rate": {"coefficients": W},
        "unknown key": good | {"lambda": 1},
        "shape": good | {"coefficients": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
        "ragged": good | {"coefficients": [[1, 0], [0]]},
        "no number": good | {"coefficients": [[1, None], [None, 1]]},
        "huge": good | {"coefficients": [["1e999999999", 0], [0, 1]]},
        "monomials": good | {"coefficients": [W, W], "monomials": ["1"]},
        "both": good | {"monomials": ["1"], "powers": [[0, 0]]},
        "half power": good | {"powers": [[0.5, 0]]},
        "negative power": good | {"powers": [[-1, 0]]},
        "two in one": good | {"monomials": ["1) + (x1"]},
        "stranger": good | {"monomials": ["z"]},
        "negative rate": good | {"rate": -1},
    }.items():
        yield why, _json(folder, content, f"{why}.json")
    yield "deep", _text(folder, "deep.json", '{"coefficients": ' + "[" * 5000)
    yield "nan", _npz(folder, coefficients=np.array([[np.nan, 0], [0, 1]]), rate=1.0)
    yield "csv header", _text(folder, "o.csv", "a,b\n1,2\n")
    for why, cells in (("row", "1,1,3,2"), ("twice", "1,1,1,2\n1,1,1,2"), ("cell", "1,1,1,x")):
        yield f"csv {why}", _text(folder, f"{why}.csv", f"monomial,row,column,value\n{cells}\n")
    yield "no zip", _text(folder, "s.npz", "PK")
    yield "no mat", _text(folder, "t.mat", "MATLAB 5.0 MAT-file" + " " * 200)
    yield "hdf5", _text(folder, "u.mat", "MATLAB 7.3 MAT-file".ljust(124) + "\x00\x02IM" + " " * 200)
    pickled = np.array([Bomb()], dtype=object)
    np.savez(folder / "v.npz", coefficients=pickled)
    yield "pickle", folder / "v.npz"
    with zipfile.ZipFile(folder / "w.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        big = io.BytesIO()
        np.save(big, np.zeros((2000, 1000)))
        archive.writestr("coefficients.npy", big.getvalue())
    yield "bomb", folder / "w.npz"


def _text(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


def test_an_array_of_another_name_is_told_which_names_are_read(folder):
    """`np.savez(file, W=W)` was sent to the documentation."""
    done = run(folder / "system.yaml", _npz(folder, W=np.eye(2), rate=1.0))
    assert done.exit_code == 2
    assert "it holds `coefficients`: W itself where that is constant" in " ".join(done.stderr.split())


@pytest.mark.slow
def test_what_is_no_such_file_is_one_located_error(folder):
    for why, path in _bad(folder):
        done = run(folder / "system.yaml", path)
        assert done.exit_code == 2, (why, done.output)
        assert path.name in done.output, why
        assert done.stdout == "", why
