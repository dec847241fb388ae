"""The controller in C against exact arithmetic: its steps, the plan that it follows, samples that are bad."""

import shutil
import subprocess
from fractions import Fraction

import handmade
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.controller.compiled import Controller, build
from tubecert.controller.data import HOME, data_of
from tubecert.controller.folder import files_of, write

BAD, END, CLIPPED = 1, 2, 4
WAVE = handmade.WAVE % ""
MOVING = [(WAVE, "nothing")] + [
    (handmade.WAVE % f", afterwards: {word}", word) for word in ("rest", "repeat")
]
PLANS = [(handmade.REST, "nothing"), *MOVING, (handmade.ANY, "nothing")]


def loop(trajectory=handmade.REST, lanes=1, **options):
    return Controller(data_of(handmade.certificate(trajectory, **options)), lanes)


def feedforward(**options):
    """A controller that hands out the plan's input."""
    tables = handmade.tables(1)
    tables.M[:] = 0
    tables.N[:] = [[1e-30, 0]]  # some controller
    return loop(z=1, controller=tables, **options)


def shipped(folder, **options):
    """The files of a certificate in a folder of their own."""
    write(str(folder), files_of(data_of(handmade.certificate(**options))))
    return folder


def product(data, names, seen):
    """[left right] seen, exactly, and the sum of the sizes."""
    rows = np.hstack([getattr(data.tables, name) for name in names])
    exact = [sum(Fraction(c) * v for c, v in zip(row, seen, strict=True)) for row in rows.tolist()]
    return exact, abs(rows) @ np.abs(np.array(seen, dtype=float))


@pytest.mark.slow
@given(
    z=st.integers(0, 4),
    seed=st.integers(0, 99),
    single=st.booleans(),
    parts=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=6),
)
@settings(max_examples=15, deadline=None)
def test_steps_are_exact_but_for_rounding(z, seed, single, parts):
    """Every sum is within gamma(z + n + 3) of the sizes of its terms: r_u and r_z of the proof."""
    arithmetic = "single" if single else "double"
    own = loop(z=z, arithmetic=arithmetic, controller=handmade.tables(z, seed))
    data, state = own.data, own.state[0]
    xs, us = (each[0] for each in data.plan.at([0]))
    unit = (z + 5) * (2.0**-24 if single else 2.0**-53) * 1.001
    for part in parts:
        y = (xs + np.array(part) * data.limits["reach"] * 0.999).astype(data.real).astype(float)
        seen = [Fraction(float(v)) for v in state["zeta"][:z]]
        seen += [Fraction(a) - Fraction(b) for a, b in zip(y, xs, strict=True)]
        (delta, size_u), (later, size_z) = product(data, "MN", seen), product(data, "FG", seen)
        [[u]] = own.step(y)
        wanted = float(min(max(Fraction(us[0]) + delta[0], Fraction("-3.1")), Fraction("3.3")))
        assert abs(u - wanted) <= unit * (size_u[0] + abs(us[0])) + 1e-37
        off = [abs(float(Fraction(float(v)) - w)) for v, w in zip(state["zeta"][:z], later, strict=True)]
        assert (np.array(off) <= unit * size_z + 1e-37).all()
    assert state["bad"] == 0


def u_star(t):
    return np.cos(t) / 3 + 0.1 * np.sin(2 * t) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["middle", "left", "continuous"])
@pytest.mark.parametrize(("trajectory", "afterwards"), MOVING)
def test_the_plan_is_taken_when_its_command_acts(trajectory, afterwards, hold):
    """x* at t_k; u* at the middle or the beginning of [t_k + delay, t_k + delay + Ts): not at t_k."""
    own = feedforward(trajectory=trajectory, afterwards=afterwards, hold=hold)
    later = 0.005 + (0.01 if hold == "middle" else 0)
    last = np.inf if afterwards == "repeat" else 1.01
    for k in range(60):
        t = min(k * 0.02, last)
        [[u]] = own.step(np.array([np.sin(t), np.cos(t)]))
        row = min(k, 50) if afterwards == "nothing" else k
        assert u == pytest.approx(u_star(min(row * 0.02 + later, last)), rel=1e-7, abs=1e-7)
        assert own.state["status"] == (END if afterwards == "nothing" and k > 50 else 0)
    assert u_star(1) != pytest.approx(u_star(1 + later), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("afterwards", "steps", "then"), [("repeat", 10, 1), ("rest", 11, 2), ("nothing", 10, 2)]
)
def test_where_the_input_jumps_it_is_taken_from_its_interval(afterwards, steps, then):
    """Command 4 acts over [.085, .105), whose middle is before the jump; command 5 over [.105, .125).

    The command of the last row acts beyond the end, over [.185, .205): there the plan is what comes afterwards.
    """
    own = feedforward(planned=handmade.held_knots(), afterwards=afterwards)
    assert own.data.plan.steps == steps
    rows = own.data.plan.rows[0]
    order = [*range(10), *(range(5) if afterwards == "repeat" else [steps - 1] * 5)]
    assert [own.step(rows[row])[0, 0] for row in order] == [1] * 5 + [2] * 5 + [then] * 5
    assert own.state["bad"] == 0


def test_a_plan_that_goes_on_is_known_after_months():
    plan = data_of(handmade.certificate(handmade.WAVE % ", afterwards: repeat", afterwards="repeat")).plan
    x, u = plan.at([k := 2**30 - 1])  # 249 days
    assert x[0] == pytest.approx([np.sin(k * 0.02), np.cos(k * 0.02)], abs=1e-7)
    assert u[0] == pytest.approx([u_star(k * 0.02 + 0.015)], abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ["double", "single"])
def test_a_bad_sample_holds_and_is_told_while_it_lasts(arithmetic):
    own = loop(lanes=3, arithmetic=arithmetic)
    [x], _ = own.data.plan.at([0])
    for bad in (np.nan, np.inf, -np.inf, 1e300, x[0] + own.data.limits["reach"][0] * 1.001):
        good, kept = own.step(x + 0.1), own.state.copy()
        assert not own.state["status"].any(), "afterwards it goes on"
        for _ in range(3 if not np.isfinite(bad) else 1):
            with np.errstate(over="ignore"):
                found = own.step(np.where([[False, False], [True, False], [False, False]], bad, x))
            assert own.state["status"].tolist() == [0, BAD, 0]
            assert found[1] == good[1], "the last correction about the plan's input"
            assert (own.state["zeta"][1] == kept["zeta"][1]).all()
    assert own.state["bad"].tolist() == [0, 11, 0]


@pytest.mark.slow
def test_what_stays_far_away_is_no_glitch_and_steered_against():
    """As a sample is that lies as far away, up to 64 times as far as is proven."""
    far, edge = loop(), loop()
    [[p, v]], _ = far.data.plan.at([0])
    for own in (far, edge):
        held = own.step(np.array([p, v]))
        assert own.step(np.array([70.0, 0.1])) == held, "the first one"
    most = np.array([p + 64 * far.data.limits["reach"][0], 0.1])
    nearer = loop()
    for y in (most, most - [0.01, 0]):
        nearer.step(y)
    for k in range(3):
        assert far.step(np.array([70.0, 0.1])) == edge.step(most) != held
        assert k or far.state["delta"] != nearer.state["delta"], "they are told apart up to there"
        assert far.state["status"] & BAD
        assert (far.state["zeta"] == edge.state["zeta"]).all()
    far.step(np.array([np.nan, 0]))
    assert (far.state["zeta"] == edge.state["zeta"]).all(), "what is not finite is held, always"


@pytest.mark.slow
def test_the_state_of_the_controller_stays_finite_while_samples_are_far():
    """64 times what is proven of it, however long that lasts: an unstable controller would be lost."""
    unstable = handmade.tables(1)
    unstable.F[:], unstable.G[:] = [[1.5]], [[2, 0]]
    own = loop(controller=unstable, z=1)
    for side in (1, -1):
        for _ in range(50):
            own.step(np.array([70.0 * side, 0.0]))
        assert own.state["zeta"] == 64 * side * own.data.limits["memory"]


@pytest.mark.slow
def test_time_goes_on_while_samples_are_bad():
    own = loop(WAVE)
    found = [own.step(np.array([np.nan, 0.0]))[0, 0] for _ in range(55)]
    wanted = own.data.plan.rows[1][:, 0].tolist()
    assert found == wanted + wanted[-1:] * 4, "the correction is 0: the plan's input, and its last"
    assert (own.state["bad"], own.state["status"]) == (51, END)


@pytest.mark.slow
def test_a_family_is_handed_its_plan():
    own = loop(handmade.ANY, lanes=2)
    xs, us = np.array([[0.5, 0.1], [-0.3, 0.0]]), np.array([[0.25], [-0.5]])
    assert own.step(xs, xs, us).tolist() == us.tolist()
    assert own.step(np.zeros(2), xs, us).shape == (2, 1)
    assert own.state["status"].tolist() == [BAD, 0], "compared with the plan that is handed in"


@pytest.mark.slow
def test_after_the_end_the_last_command_is_held_also_where_the_plan_goes_on():
    """A planner that hands in more, and a formula after 2^30 samples: u* was added to the last correction."""
    family, formula = loop(handmade.ANY), loop(handmade.WAVE % ", afterwards: repeat", afterwards="repeat")
    x, u = np.array([0.1, 0.0]), np.array([0.25])
    before = [family.step(x, x, u + k / 100) for k in range(50)][-1]
    assert family.state["status"] == 0
    assert family.step(x, x, u - 1) == before
    assert family.state["status"] == END

    formula.state["k"] = 2**30 - 1
    last = formula.data.plan.at([2**30 - 1])[0][0]
    before = formula.step(last)
    assert [formula.step(last), formula.state["status"]] == [before, END]


@pytest.mark.slow
@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf])
def test_a_plan_that_is_missing_holds_the_last_command(missing):
    """It was the lowest of all inputs, and the highest for inf."""
    own = loop(handmade.ANY)
    x, u = np.array([0.1, 0.0]), np.array([0.25])
    assert own.step(x, x, u * missing) == 0, "before there is one: 0, as far as limits let it"
    held = own.step(x + 0.1, x, u)
    assert own.state["status"] == 0
    kept = own.state.copy()
    assert own.step(x, x, u * missing) == held != 0
    assert (own.state["status"], own.state["bad"]) == (BAD, 2)
    assert (own.state["zeta"] == kept["zeta"]).all()


@pytest.mark.slow
def test_inputs_stay_in_the_range_and_a_limit_that_acts_is_told():
    big = handmade.tables(1)
    big.N[:] = [[100.0, 0.0]]
    own = loop(controller=big, z=1)
    [x], _ = own.data.plan.at([0])
    for side, limit in ((1, Fraction("3.3")), (-1, Fraction("-3.1"))):
        [[u]] = own.step(x + np.array([0.2 * side, 0.0]))
        assert own.state["status"] == CLIPPED
        beyond = np.nextafter(u, np.inf * side)
        assert Fraction(u) * side <= limit * side < Fraction(float(beyond)) * side


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ["double", "single"])
@pytest.mark.parametrize(("trajectory", "afterwards"), PLANS)
def test_the_self_test_passes_and_notices_a_wrong_step_or_plan(tmp_path, trajectory, afterwards, arithmetic):
    folder = shipped(tmp_path / "a b", trajectory=trajectory, afterwards=afterwards, arithmetic=arithmetic)

    def wrong():
        build(folder, ["controller.c", "selftest.c", "-o", "selftest"])
        return subprocess.run([folder / "selftest"], capture_output=True, check=False).returncode

    assert wrong() == 0
    changes = [("controller.c", "sum += G[i][j] * dy[j]", "sum += G[i][j] * dy[0]")]
    changes.append(("controller.c", "if (s->k >= STEPS)", "if (s->k > STEPS)"))
    if afterwards == "repeat":
        changes.append(("controller_data.h", "sin(t)", "sin(t * 1.0000001)"))
    for name, old, new in changes:
        right = (folder / name).read_text()
        (folder / name).write_text(right.replace(old, new, 1))
        assert wrong() == 1, name
        (folder / name).write_text(right)


@pytest.mark.slow
@pytest.mark.parametrize("flag", ["-ffast-math", "-ffinite-math-only", "-D_M_FP_FAST"])
def test_fast_math_is_refused(tmp_path, flag):
    with pytest.raises(OSError, match="removes the test"):
        build(shipped(tmp_path / "c"), [flag, "-c", "controller.c"])


FROM_CPP = """
#include "controller.h"
int main() { State s; real y[NX] = {}, u[NU]; controller_start(&s); return controller_step(&s, y, u) & STATUS_END; }
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="no compiler of C++ here")
def test_a_program_in_cpp_calls_it(tmp_path):
    folder = shipped(tmp_path / "c")
    (folder / "main.cpp").write_text(FROM_CPP)
    build(folder, ["-c", "controller.c"])
    call = ["g++", "-Wall", "-Wextra", "-Werror", "main.cpp", "controller.o", "-o", "main"]
    subprocess.run(call, cwd=folder, check=True)
    assert subprocess.run([folder / "main"], check=False).returncode == 0


ATTACK = """
#include "controller.h"
#include <math.h>
int main(void) {
  static State s; uint64_t seed = 7; uint32_t bad = 0; real y[NX], u[NU];
  const real odd[] = {(real)NAN, (real)INFINITY, -(real)INFINITY, (real)1e30, (real)-1e30};
  for (long t = 0; t < 1000000; t++) {
    for (int i = 0; i < NX; i++) {
      seed = seed * 6364136223846793005u + 1442695040888963407u;
      y[i] = (real)((double)(seed >> 11) / 9007199254740992.0 - 0.5) * (real)0.5 + (i == 0 ? (real)0.5 : 0);
    }
    if (t % 100 == 0) { y[t / 100 % NX] = odd[t / 100 % 5]; bad++; }
    const uint32_t status = controller_step(&s, y, u);
    if (!(u[0] >= -3.1001 && u[0] <= 3.3001) || (status & STATUS_BAD) != (t % 100 == 0) || s.bad != bad) return 1;
    for (int i = 0; i < NZ; i++) if (!(fabs(s.zeta[i]) <= 64 * 0.3001)) return 2;
  }
  return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ["double", "single"])
def test_a_million_samples_of_which_some_are_bad(tmp_path, arithmetic):
    """Under sanitizers: every input finite and in the proven range, every bad sample told."""
    folder = shipped(tmp_path / "c", arithmetic=arithmetic, z=3)
    (folder / "attack.c").write_text(ATTACK)
    flags = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    try:
        build(folder, [*flags, "controller.c", "attack.c", "-o", "attack"])
    except OSError:
        pytest.skip("no sanitizers here")
    done = subprocess.run([folder / "attack"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_the_runtime_is_short_and_files_are_the_same_every_time():
    assert (
        sum(len((HOME / name).read_text().splitlines()) for name in ("controller.c", "controller.h")) <= 120
    )
    one, other = (files_of(data_of(handmade.certificate(WAVE))) for _ in range(2))
    assert one == other


def test_without_a_compiler_it_is_said(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(OSError, match="no C compiler on PATH"):
        loop(controller=handmade.tables(2, 77))
