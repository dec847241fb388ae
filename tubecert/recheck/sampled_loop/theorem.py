"""The inequalities of the sampled loop at every sample: of the errors, of what the controller adds, of its memory.

s = (e, zeta, v_1..v_b, eta, heard): the error, the controller's memory, the deltas of the b samples before (which the
delay keeps waiting), the slow signals, together xi; and what is heard at a sample, noise and rounding of dy, rounding
of u and of zeta. b(k) bounds an output at sample k if the loop has kept to its boxes before; below what is claimed at
every k there is no first exit. An output is a row times s, carried back lag by lag: r_i is the middle of the enclosed
q_i = r_(i-1) AA, without what is heard. Any numbers would do ("free rows"): what they miss, |q_i - r_i| times the box
of s, is added. From a lag of its own on a slow signal is taken for any one ("cut"). A product of a row with balls
around 0 is a sum of magnitudes. Implements: theory of the sampled loop, sections 2, 3 and 5.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from itertools import accumulate, chain, pairwise, product

from flint import arb, arb_mat, ctx

from tubecert.recheck.balls import Ball, around_zero, between, ceiling, exact, joined, picked, sizes, stacked
from tubecert.recheck.cover import CONFIRMED, Outcome, time_is_up, told
from tubecert.recheck.sampled_loop.record import Recipe, Stage
from tubecert.recheck.sampled_loop.remainders import Size, Slow

_SETUP_BITS = 128  # of matrices: rows are carried in those of the context
_ROUNDED = 1 + 1e-12  # what floats lose in a length
_TELLS = 64  # lags
_MOST_TERMS = 8_000_000  # kept: outputs x phases x lags


class Loop:
    """A (n, n), B (n, m), H (n, r); tables F (z, z), G (z, n), M (m, z), N (m, n); sample time and delay in s.

    `whole` samples of delay, Q, and the `rest` tau'; `waiting`, b: of how many earlier samples a delta acts or waits.
    `parts`: rows that pick e (n), zeta (z), v_1..v_b (m each), eta (r), with which the `width` entries of xi end, and
    what is heard of dy (n), u (m), zeta (z). `sent`: rows of delta_k, v_1, .., v_b, (m, ..) each.
    """

    def __init__(
        self, A: arb_mat, B: arb_mat, H: arb_mat, tables: Sequence[arb_mat], times: tuple[Fraction, Fraction]
    ) -> None:
        (F, G, M, N), (sample, delay) = tables, times
        self.A, self.B, self.H, self.sample = A, B, H, sample
        self.whole, self.rest = divmod(delay, sample)
        self.waiting = self.whole + (self.rest > 0)
        n, m, z = A.nrows(), B.ncols(), F.nrows()
        ends = [0, *accumulate([n, z, *[m] * self.waiting, H.ncols(), n, m, z])]
        self.parts, self.width, self.size = (
            [picked(range(a, b), ends[-1]) for a, b in pairwise(ends)],
            *ends[-4::3],
        )
        e, zeta, *waiting, _, heard, rounded, lost = self.parts
        self.sent = [N * (e + heard) + M * zeta + rounded, *waiting]
        known = picked(range(self.width), self.size)
        self.without_heard = known.transpose() * known
        self._kept = G * (e + heard) + F * zeta + lost

    def flow(self, t: Ball, order: int = 0) -> arb_mat:
        """e^(S t) with S = [A H B; 0 0 0; 0 0 0], or its derivative of an order, for every t of the ball.

        It moves (e, eta, a held input): with P = e^(A t) and J its integral, e^(S t) = [P JH JB; 0 I 0; 0 0 I].
        """
        rates = joined([[self.A, self.H, self.B]])
        rates = stacked([rates, arb_mat(rates.ncols() - rates.nrows(), rates.ncols())])
        found = (rates * t).exp()
        for _ in range(order):
            found = rates * found
        return found

    def error(self, s: Ball, order: int = 0, *, later: bool) -> arb_mat:
        """Rows of e(t_k + s), (n, ..), but for what acts on it from t_k on; or their derivative of an order.

        `later`: s is not before tau'.
        """
        e, eta, before, now = self.parts[0], self.parts[-4], self.sent[-1], self.sent[self.whole]
        found = self.flow(s, order) * stacked([e, eta, before])
        if later:
            found += self.flow(s - exact(self.rest), order) * stacked([0 * e, 0 * eta, now - before])
        return picked(range(e.nrows()), found.nrows()) * found

    @property
    def step(self) -> arb_mat:
        """Rows of xi_(k+1), AA and NN beside one another; of what is heard then, nothing."""
        moved, none = self.error(exact(self.sample), later=True), arb_mat(self.size - self.width, self.size)
        return stacked([moved, self._kept, *self.sent[:-1], self.parts[-4], none])


@dataclass(frozen=True)
class Phase:
    """What is known at samples from `start` on, while `stage` lasts and commands of the same stages act or wait.

    The box of s, without the noise; the remainder `acting` through [I, B] (n + m).
    """

    start: int
    stage: Stage
    box: Sequence[Ball]
    acting: Sequence[Ball]


@dataclass(frozen=True)
class Amplitudes:
    """Of signals: balls, one column per phase; of some, in place of these or beside them, the Euclidean length."""

    each: arb_mat
    lengths: Sequence[tuple[arb_mat, arb_mat]]  # which signals, a column each, and how large

    @classmethod
    def around_zero(cls, known: Iterable[Sequence[Ball]], sizes: Iterable[tuple[int, Size]]) -> Amplitudes:
        """Of signals `known` phase by phase; of those from a place on, a size besides."""
        rows, lengths = [list(row) for row in zip(*known, strict=True)], []
        for at, own in sizes:
            if own.length:
                which = picked(range(at, at + len(own.each)), len(rows)).transpose()
                lengths.append((which, around_zero(arb_mat([own.each[:1] * len(rows[at])]))))
            else:
                for i, most in enumerate(own.each, at):
                    rows[i] = [x + most for x in rows[i]]
        return cls(around_zero(arb_mat(rows)), lengths)

    def of(self, rows: arb_mat) -> arb_mat:
        """What they do through rows (p, signals), at most: balls, (p, phases)."""
        found = rows * self.each
        for which, bound in self.lengths:
            found += arb_mat([[_long(row)] for row in (rows * which).tolist()]) * bound
        return found


def _long(row: Sequence[Ball]) -> Ball:
    """At least the Euclidean length, in floats."""
    return arb(math.hypot(*[float(x.abs_upper()) for x in row]) * _ROUNDED + 1e-150)


def phases_of(stages: Sequence[Stage], waiting: int) -> Iterator[tuple[int, Stage, tuple[Fraction, ...]]]:
    """Starts of phases and their stages, with the most of the deviations (m) that act or wait."""
    starts = [own.start for own in stages]
    begins = sorted({0, *starts, *(k + waiting for k in starts[1:])})
    for begin, end in pairwise([*begins, begins[-1] + 1]):
        first, last = (bisect_right(starts, max(0, k)) for k in (begin - waiting, end - 1))
        most = zip(*(own.deviations for own in stages[first - 1 : last]), strict=True)
        yield begin, stages[bisect_right(starts, begin) - 1], tuple(map(max, most))


@dataclass(frozen=True)
class Inequalities:
    """b(k) against what is claimed of e_1 .. e_n at all times, then of delta and zeta at every sample up to `last`.

    `winds`: columns (n, k), and how large. e(0) is in `error` (n), a point or a box, within a `radius` beside that: in
    the first box, or the claims of e at sample 0 do not hold.
    """

    loop: Loop
    recipe: Recipe
    phases: Sequence[Phase]
    noise: Size
    winds: Sequence[tuple[arb_mat, Size]]
    slow: Sequence[Slow]
    error: Sequence[Ball]
    radius: Ball
    last: int

    def output(self, f: int) -> Outcome:
        """An output stays below what is claimed."""
        most = [exact(own.stage.boxes[f]) for own in self.phases]
        bounds = ((k, reduce(arb.max, self.bounds(f, k)), most[self.phase(k)]) for k in range(self.last + 1))
        over = [(ceiling(b / claimed), k) for k, b, claimed in bounds if not b < claimed]
        if not over:
            return CONFIRMED
        share, k = max(over)
        return Outcome(verdict="undecided", why=f"sample {k}: the bound is {share:.6g} of what is claimed")

    def bounds(self, f: int, k: int) -> list[Ball]:
        """b(k) of an output: of |e_i| on every piece of the sample."""
        n, last, p = len(self.error), len(self.nodes) - 1, self.phase(k)
        if f >= n:
            return [self._carried[n * last + f][k]]
        ends = [own[k] for own in self._carried[f : n * (last + 1) : n]]
        off = [own[f][p].abs_upper() for own in self._off]
        return [x.max(y) + more for (x, y), more in zip(pairwise(ends), off, strict=True)]

    def phase(self, k: int) -> int:
        """The phase of a sample."""
        return bisect_right(self.phases, k, key=lambda own: own.start) - 1

    @cached_property
    def nodes(self) -> list[Fraction]:
        """Times of a sample between which nothing jumps: equal parts, and tau'."""
        equal = {self.loop.sample * Fraction(a, self.recipe.pieces) for a in range(self.recipe.pieces + 1)}
        return sorted(equal | {self.loop.rest})

    # -- signals

    @cached_property
    def _known(self) -> Amplitudes:
        """Of s."""
        return Amplitudes.around_zero((own.box for own in self.phases), [(self.loop.width, self.noise)])

    @cached_property
    def _begun(self) -> Amplitudes:
        """xi_0, signed where it is known."""
        loop, n, slow = self.loop, len(self.error), [arb(0, own.first.abs_upper()) for own in self.slow]
        still, heard = [arb(0)] * (loop.width - n - len(slow)), [arb(0)] * (loop.size - loop.width)
        near = loop.parts[0].transpose(), arb_mat([[arb(0, self.radius)]])
        begun = arb_mat([[x] for x in (*self.error, *still, *slow, *heard)])
        return Amplitudes(begun, [near] if self.radius > 0 else [])

    @cached_property
    def _acting(self) -> Amplitudes:
        """Of slow signals (r) and of their rates (r), of the remainder, of winds."""
        slow = [*(own.size for own in self.slow), *(own.rate for own in self.slow)]
        counts = [len(own.each) for _, own in self.winds]
        known = [[*slow, *own.acting, *[arb(0)] * sum(counts)] for own in self.phases]
        places = accumulate(counts, initial=len(slow) + len(self.phases[0].acting))
        return Amplitudes.around_zero(known, zip(places, (own for _, own in self.winds), strict=False))

    @cached_property
    def _entries(self) -> arb_mat:
        """Through which columns these act on e, on eta and on the input, (n + r + m, signals)."""
        n, r, loop, winds = len(self.error), len(self.slow), self.loop, (own for own, _ in self.winds)
        on_e = joined([[loop.H, arb_mat(n, r), picked(range(n), n), loop.B, *winds]])
        return stacked([on_e, picked(range(r, 2 * r), on_e.ncols()), arb_mat(loop.B.ncols(), on_e.ncols())])

    def _gamma(self, age: Ball, order: int = 0) -> arb_mat:
        """What they do to s in that time, (size, signals), or its derivative of an order."""
        e, *_, eta, _, _, _ = self.loop.parts
        held = arb_mat(self.loop.B.ncols(), self.loop.size)  # no entry of s
        return stacked([e, eta, held]).transpose() * (self.loop.flow(age, order) * self._entries)

    def _kernels(self, until: Fraction) -> list[arb_mat]:
        """Through these rows have int_0^until |r gamma| at most: |g| <= chord + (d^3/12 a panel) sup|g''|."""
        panels = self.recipe.panels
        d = exact(until) / panels
        ages = [d * k for k in range(panels + 1)]
        chords = [self._gamma(age) * (d / 2 if k in (0, panels) else d) for k, age in enumerate(ages)]
        bent = [sizes(self._gamma(between(a.lower(), b.upper()), 2)) for a, b in pairwise(ages)]
        return [*chords, around_zero(sum(bent[1:], start=bent[0]) * (d * d * d / 12))]

    def _through(self, rows: arb_mat, kernels: Sequence[arb_mat], off: Iterable[tuple[int, int]]) -> arb_mat:
        """What acts through rows and each of the kernels, but for signals that are off: (p, phases)."""
        found = arb_mat(rows.nrows(), len(self.phases))
        for own in kernels:
            shown = rows * own
            for place in off:
                shown[place] = 0
            found += self._acting.of(shown)
        return found

    # -- within a sample

    def _within(self, kernels: Sequence[arb_mat]) -> arb_mat:
        """What acts on e within a sample, slow signals by their rates: (n, phases)."""
        rates_only = list(product(range(len(self.error)), range(len(self.slow))))
        return self._through(self.loop.parts[0], kernels, rates_only)

    @cached_property
    def _off(self) -> list[list[list[Ball]]]:
        """How far e may be from its chord on every piece, d^2/8 sup|e''|, by state and phase."""
        found = []
        with ctx.workprec(_SETUP_BITS):
            for a, b in pairwise(self.nodes):
                s, square = between(exact(a).lower(), exact(b).upper()), exact((b - a) ** 2 / 8)
                rates = self.loop.error(s, 2, later=a >= self.loop.rest)
                found.append(((self._known.of(rates) + self._within([self._gamma(s, 1)])) * square).tolist())
        return found

    # -- from sample to sample

    @cached_property
    def _carried(self) -> list[list[Ball]]:
        """b(k) of e at every node, then of delta and of zeta, k = 0 .. last.

        Raises `ArithmeticError` if these are too many, or the time is up.
        """
        lags, last = min(self.recipe.lags, self.last), self.last
        terms, started = [], []
        for q, found in self._lags(lags):
            terms.append(sizes(found).tolist())
            started.append(sizes(self._begun.of(q)).entries())
        late, later = self._known.of(q * self.loop.without_heard).tolist(), range(1, last + 1 - lags)
        ends = [*(own.start for own in self.phases), last + 1]
        spans = [  # by sample: which lags, from one to another, are of samples of which phase
            [
                (p, max(0, k + 1 - end), min(lags, k - begin) + 1)
                for p, (begin, end) in enumerate(pairwise(ends))
            ]
            for k in range(last + 1)
        ]
        spans = [[(p, low, high) for p, low, high in own if low < high] for own in spans]
        carried = []
        for f in range(q.nrows()):
            columns = zip(*(own[f] for own in terms), strict=True)
            sums = [list(accumulate(column, initial=arb(0))) for column in columns]
            gathered = (sum((sums[p][b] - sums[p][a] for p, a, b in own), start=arb(0)) for own in spans)
            rest = chain((own[f] for own in started), (late[f][self.phase(k)].abs_upper() for k in later))
            carried.append([x + y for x, y in zip(gathered, rest, strict=True)])
        return carried

    def _lags(self, lags: int) -> Iterator[tuple[arb_mat, arb_mat]]:
        """At every lag the enclosed rows q; what acts at its sample, and from there to the one after: (p, phases)."""
        loop, n, r = self.loop, len(self.error), len(self.slow)
        with ctx.workprec(_SETUP_BITS):
            nodes = [loop.error(exact(s), later=s >= loop.rest) for s in self.nodes]
            q, step = stacked([*nodes, loop.sent[0], loop.parts[1]]), loop.step
            acting = [self._within(self._kernels(s)) for s in self.nodes]
            found = stacked([*acting, arb_mat(q.nrows() - n * len(nodes), len(self.phases))])
            kernels = self._kernels(loop.sample)
        if q.nrows() * len(self.phases) * lags > _MOST_TERMS:
            raise ArithmeticError("there are too many rows, phases and lags")
        each = enumerate(self.recipe.cuts[:n] * len(nodes) + self.recipe.cuts[n:])
        cuts = {(f, c): lag for f, row in each for c, lag in zip(range(r), row, strict=True)}
        off, eta = set(cuts), loop.width - r  # up to its cut a signal counts by its rate, then by its size
        owed: dict[tuple[int, int], Ball] = {}
        for lag in range(lags + 1):
            if lag % _TELLS == 0 and time_is_up():
                raise ArithmeticError("the time was up")
            if lag % _TELLS == 0 and (tell := told()) is not None:
                tell(lag, lag / (lags + 1))
            rows = q.mid() * loop.without_heard
            missed = q - rows
            for place, entry in owed.items():
                missed[place] = entry
            yield q, found + self._known.of(missed)
            owed = {(f, eta + c): rows[f, eta + c] for (f, c), at in cuts.items() if at == lag}
            for f, c in owed:
                rows[f, c] = 0
                off ^= {(f, c - eta), (f, c - eta + r)}
            found, q = self._through(rows, kernels, off), rows * step
            for f, c in (place for place, at in cuts.items() if at <= lag):
                q[f, eta + c] = 0
