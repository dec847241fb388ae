"""The driver of the sampled loop and the engine: against other integrators, and exact exponentials."""

from functools import partial
from itertools import count, pairwise

import numpy as np
import pytest
from loops import proven, setting
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tubecert.controller.recursion import linear
from tubecert.simulation.sampled.attack import Attack, Lanes
from tubecert.simulation.sampled.loop import NOBODYS, Run
from tubecert.simulation.sampled.setting import courses_of


class Scripted(Lanes):
    """Three lanes whose signals are drawn beforehand: noise and h by samples, wind by their parts."""

    def __init__(self, own):
        attack = Attack(own, seed=0)
        super().__init__(attack, range(len(attack.aims), len(attack.aims) + 3))
        self.own[:] = False

    def noise(self, k):
        return np.random.default_rng([k + 1, 5]).uniform(-1, 1, self.off.shape)

    def wind(self, k):
        size = len(self.setting.lengths), self.setting.loop.E.shape[1], 3
        return np.random.default_rng([k + 1, 4]).uniform(-1, 1, size)

    def h(self, k):
        return np.random.default_rng([k + 1, 3]).uniform(-1, 1, (len(self.setting.slow.size), 3))

    def signals(self, k, now=None):
        return self.noise(k), self.wind(k), self.h(k)


def run(own, level=1):
    """Where three lanes are after every sample, and the lanes."""
    lanes = Scripted(own)
    return Run(lanes, partial(linear, own.tables), 2**level).seen().x[1:], lanes


@pytest.mark.slow
@pytest.mark.parametrize("delay", ["0", "0.025", "0.05", "0.125"])
def test_commands_act_after_their_delay_as_matrix_exponentials_say(delay):
    """Delays of 0, a half, 1 and 2.5 samples; h goes straight from sample to sample."""
    own = setting("cart", ("delay: 0.02", f"delay: {delay}"), duration="2")
    path, lanes = run(own)
    Ts, tau, N = 0.05, float(delay), proven("cart").controller.N
    x = lanes.off
    commands: dict[int, np.ndarray] = {}
    for k in range(own.samples):
        commands[k] = N @ (x + lanes.noise(k))
        for part, (begin, end) in enumerate(pairwise(map(float, own.nodes))):
            acting = int(np.floor((k * Ts + (begin + end) / 2 - tau) / Ts))
            slope = (lanes.h(k) - lanes.h(k - 1)) / Ts
            push = (
                commands.get(acting, np.zeros((1, 3))) + lanes.wind(k)[part] + lanes.h(k - 1) + begin * slope
            )
            x = (expm(np.eye(4, 4, 1) * (end - begin)) @ np.vstack([x, push, slope]))[:2]
        np.testing.assert_allclose(path[k], x, atol=1e-12)


@pytest.mark.slow
def test_the_h_of_a_specification_acts_beside_the_inputs():
    """As if it were a part of f."""
    inside = ("0.2*sin(t)", "0"), ("f: [v, 0]", 'f: [v, "0.2*sin(p)"]')
    paths = []
    for changes in ([("0.2*sin(t)", "0.2*sin(p)")], inside):
        own = setting("cart", *changes, duration="1")
        lanes, none = Scripted(own), np.zeros((len(own.slow.size), 3))
        lanes.own[:], lanes.off[:], lanes.h = True, 0.05, lambda k, none=none: none
        paths.append(Run(lanes, partial(linear, own.tables), 2).seen().x)
    np.testing.assert_allclose(*paths, atol=1e-13)
    assert abs(paths[0][-1] - run(setting("cart", duration="1"))[0][-1]).max() > 1e-3


@pytest.mark.slow
def test_the_input_of_the_plan_is_that_of_the_time_in_which_a_command_acts():
    """A controller that hands out what the plan holds from k Ts + delay on adds nothing; delay: 1.75 samples."""
    own = setting("pendulum", ("delay: 0.015", "delay: 0.035"), duration="1")
    lanes, j = Scripted(own), count(2)
    found = Run(lanes, lambda _: lambda y, x, u: lanes.course.held[next(j)], 2).seen()
    assert abs(np.diff(lanes.course.held, axis=0)).max() > 0.01
    assert (found.most[2] == 0).all()


@pytest.mark.slow
def test_of_a_plan_that_leaves_its_family_nothing_more_is_seen():
    own = setting("pendulum", duration="0.4")
    lanes = Scripted(own)
    lanes.course = lanes.course._replace(ends=np.array([3, 99, 99]))
    found = Run(lanes, partial(linear, own.tables), 2).seen()
    assert found.stopped.tolist() == [NOBODYS, 0, 0]
    assert found.node[:, 0].max() < 3 * len(own.lengths) < found.node[:, 1].max()
    assert np.isnan(found.x[3:, :, 0]).all()
    assert np.isfinite(found.x[:3]).all()


@pytest.mark.slow
def test_a_nonlinear_plant_is_integrated_as_by_another_method():
    """And the error that is told is not below the true one."""
    own = setting("pendulum", duration="0.8")
    (coarse, _), (path, lanes) = (run(own, level) for level in (0, 1))
    course = lanes.course
    N, Ts = proven("pendulum").controller.N, 0.02
    g, commands, x = lanes.parameters[0], [np.zeros((1, 3))], course.x[0] + lanes.off
    for k in range(own.samples):
        plan = course.x[k * len(own.lengths)]
        commands.append(N @ (x + lanes.noise(k) - plan))
        for late, begin, end in ((True, 0.0, 0.015), (False, 0.015, Ts)):
            u = (course.held[k] + commands[-2] if late else course.held[k + 1] + commands[-1])[0]

            def slope(t, z, u=u):
                p, v = z.reshape(2, 3)
                return np.concatenate([v, -g * np.sin(p) - 0.1 * v + u])

            solved = solve_ivp(slope, (begin, end), x.ravel(), method="DOP853", rtol=1e-12, atol=1e-13)
            x = solved.y[:, -1].reshape(2, 3)
    assert abs(path[-1] - x).max() < min(1e-8, 2 * abs(path - coarse).max() + 1e-12)


@pytest.mark.slow
def test_plans_of_a_family_are_members_of_it():
    """x* in P, u* in Q with its rate, and what it misses of the dynamics within the defect; as long as they count."""
    own = setting("pendulum", duration="4")
    dt = own.lengths
    course = courses_of(own, own.spec.trajectory.bundle, np.random.default_rng(0).random((3 * 3 + 2, 50)))
    assert np.mean(course.ends) > 0.95 * own.samples
    assert (abs(course.held) <= 0.3).all()
    assert abs(np.diff(course.held, axis=0)).max() <= 1 * own.Ts * (1 + 1e-9)
    x = course.x[:: len(own.lengths)]
    counts = np.arange(len(x))[:, None] <= course.ends
    assert (abs(x).max(axis=1)[counts] <= 0.2).all()
    assert x[:, 0].max() > 0.1  # they use what there is
    middle, step = (course.x[1:] + course.x[:-1]) / 2, np.tile(dt, own.samples)[:, None]
    slope = (course.x[1:] - course.x[:-1]) / step[:, None]
    assert abs(slope[:, 0] - middle[:, 1]).max() <= 0.01 + 1e-4  # p' = v up to the defect, and the chord
    u = slope[:, 1] + np.sin(middle[:, 0]) + 0.1 * middle[:, 1]
    assert abs(u).max() <= 0.3 + 0.01 + 1e-3
