"""What surrounds the programs of a controller in Python: the only texts that are read, and what they do, in C.

A loop in Python is one of these, token by token but for comments, blanks and the first string of a function; there it
does what stands beside it in C. So the two have to say the same, statement by statement, and whoever changes one of
them looks at the other.
"""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.recheck.code.lookups import form_of
from tubecert.recheck.code.pieces import MEAN


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """Which loop it is; `pieces`: of so many a plan through knots is made, 0 if it is none; `meets` of a sample."""

    inputs: int
    states: int
    adds_plan: bool
    ends: bool
    seldom: bool
    predicts: bool
    swept: bool
    pieces: int
    meets: int
    panels: int
    sweeps: int


@dataclass(frozen=True, slots=True)
class Pair:
    """The same function in both languages. In Python `NUMBER_a` stands for a number, which C has as `{NUMBER_a}`."""

    python: str
    c: str


def search(name: str, begins: str, count: int) -> Pair:
    """The last of numbers that a value is not below."""
    return Pair(
        f"""
def {name}(t):
    low, high = 0, len({begins}) - 1
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if t >= {begins}[middle] else (low, middle - 1)
    return low
""",
        f"""
static int {name}(real t) {{
    int low = 0, high = {count} - 1, k;
    for (k = 0; k < {max(1, (count - 1).bit_length())}; k++) {{
        const int middle = (low + high + 1) / 2;
        if (low < high) {{
            if (t >= {begins}[middle]) {{ low = middle; }} else {{ high = middle - 1; }}
        }}
    }}
    return low;
}}
""",
    )


def table(name: str, count: int) -> Pair:
    """The function of a table."""
    return Pair(
        f"""
def table_{name}(x):
    low, high = 0, len(AT_{name}) - 1
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if x >= AT_{name}[middle] else (low, middle - 1)
    s, c = x - AT_{name}[low], CUBIC_{name}[low]
    return c[0] + s * (c[1] + s * (c[2] + s * c[3]))
""",
        form_of(name, count),
    )


def functions(own: Loop) -> dict[str, Pair]:
    """Every function beside the programs and tables, by its name in Python."""
    found = {"on_plan": _on_plan(own), "feedforward": _FEEDFORWARD}
    if own.pieces:
        found["piece"] = search("piece", "START", own.pieces)
    if not own.adds_plan:
        found["mean_of_plan"] = _mean(own)
    if own.swept:
        found["geodesic"] = _geodesic(own)
    return found


def _on_plan(own: Loop) -> Pair:
    python = "def on_plan(t):\n" + ("    t = t if t < HORIZON else HORIZON\n" if own.ends else "")
    begin = "static void on_plan(real t, real x[N], real u[M]) {\n    const real s = "
    begin += "t < CONTROLLER_HORIZON ? t : CONTROLLER_HORIZON;" if own.ends else "t;"
    if not own.pieces:
        return Pair(f"{python}    return plan((t,))\n", f"{begin} plan(&s, x, u); }}")
    return Pair(
        f"""{python}
    k = piece(t)
    s = t - START[k]
    x = tuple(a[0] + s * (a[1] + s * (a[2] + s * a[3])) for a in X[k])
    return x, tuple(a[0] + s * a[1] for a in U[k])
""",
        f"""{begin}
    const int k = piece(s);
    const real r = s - START[k];
    int i;
    for (i = 0; i < N; i++) {{
        x[i] = X[k][i][0] + r * (X[k][i][1] + r * (X[k][i][2] + r * X[k][i][3]));
    }}
    for (i = 0; i < M; i++) {{ u[i] = U[k][i][0] + r * U[k][i][1]; }}
}}
""",
    )


_FEEDFORWARD = Pair(
    "def feedforward(t):\n    return np.array(on_plan(t)[1])\n",
    "void controller_feedforward(real t, real u[M]) { real x[N]; on_plan(t, x, u); }",
)


def _mean(own: Loop) -> Pair:
    if own.pieces:
        return Pair(
            """
def mean_of_plan(begin, end):
    k, length, total = piece(begin), end - begin, [0.0] * len(INPUTS)
    for _ in range(MEETS):
        until = START[k + 1] if k + 1 < len(START) and START[k + 1] < end else end
        middle = 0.5 * (begin + until) - START[k]
        share = (until - begin) / length
        total = [p + share * (a[0] + middle * a[1]) for p, a in zip(total, U[k])]
        begin = until
        k = k if begin == end or k + 1 == len(START) else k + 1
    return tuple(total)
""",
            MEAN % {"suffix": "", "passes": own.meets},
        )
    return Pair(
        """
def mean_of_plan(begin, end):
    return gauss(on_plan(begin + NUMBER_a)[1], on_plan(begin + NUMBER_b)[1], on_plan(begin + NUMBER_c)[1])
""",
        """
static void mean_of_plan(real begin, real end, real mean[M]) {
    real x[N], a[M], b[M], c[M];
    on_plan(begin + {NUMBER_a}, x, a);
    on_plan(begin + {NUMBER_b}, x, b);
    on_plan(begin + {NUMBER_c}, x, c);
    gauss(a, b, c, mean);
}
""",
    )


def _geodesic(own: Loop) -> Pair:
    size = own.panels * own.states
    return Pair(
        f"""
def geodesic(x, y):
    w = [(0.0,) * {own.states}] * PANELS
    for k in range(SWEEPS + 1):
        p = v = (0.0,) * {own.states}
        for each in w:
            p, v = onward(p, v, each)
        first = tuple((b - a) - c for a, b, c in zip(x, y, p))
        last = tuple(a + b for a, b in zip(first, v))
        p, v = x, first
        for j in range(PANELS if k < SWEEPS else 0):
            bent = symbols(*halfway(p, v, w[j]))
            p, v = onward(p, v, w[j])
            w[j] = bent
    return first, last
""",
        f"""
static void geodesic(const real x[N], const real y[N], real first[N], real last[N]) {{
    real w[{size}], a[N], b[N], p[N], v[N], q[N], s[N];
    int i, j, k;
    for (j = 0; j < {size}; j++) {{ w[j] = 0.0; }}
    for (k = 0; k <= {own.sweeps}; k++) {{
        for (i = 0; i < N; i++) {{ p[i] = 0.0; v[i] = 0.0; }}
        for (j = 0; j < {own.panels}; j++) {{
            for (i = 0; i < N; i++) {{ a[i] = w[j * N + i]; }}
            onward(p, v, a, q, s);
            for (i = 0; i < N; i++) {{ p[i] = q[i]; v[i] = s[i]; }}
        }}
        for (i = 0; i < N; i++) {{
            first[i] = (y[i] - x[i]) - p[i];
            last[i] = first[i] + v[i];
        }}
        for (i = 0; i < N; i++) {{ p[i] = x[i]; v[i] = first[i]; }}
        if (k < {own.sweeps}) {{
            for (j = 0; j < {own.panels}; j++) {{
                for (i = 0; i < N; i++) {{ a[i] = w[j * N + i]; }}
                halfway(p, v, a, q, s);
                symbols(q, s, b);
                onward(p, v, a, q, s);
                for (i = 0; i < N; i++) {{ p[i] = q[i]; v[i] = s[i]; w[j * N + i] = b[i]; }}
            }}
        }}
    }}
}}
""",
    )


def methods(own: Loop) -> tuple[Pair, ...]:
    """The class, method by method; in C the feedback, what is predicted, `start` and `step`."""
    found = (_begun(own), _start(own), _step(own), _feedback(own))
    return (*found, _predicted(own)) if own.predicts else found


def _begun(own: Loop) -> Pair:
    return Pair(
        f"""
def __init__(self):
    self.sample = 0
    self.status = 0
    self.y = self.f = None
    self.q = (0.0,) * {own.inputs}
    self.feedback = self.held = self.before = (0.0,) * {own.inputs}
""",
        "",
    )


def _start(own: Loop) -> Pair:
    return Pair(
        """
def start(self, y):
    self.__init__()
    self.feedback = self._law(tuple(map(float, y)), 0.0)
    self.held = self.before = self.feedback
    return np.array(self.held)
""",
        f"""
void controller_start(controller_state *c, const real y[N], real u[M]) {{
    int i;
    feedback(y, 0.0, u);
    c->sample = 0;
    {"c->since = 0;" if own.seldom else ""}
    for (i = 0; i < M; i++) {{
        c->q[i] = 0.0;
        c->feedback[i] = u[i];
        c->held[i] = u[i];
        c->before[i] = u[i];
    }}
}}
""",
    )


def _step(own: Loop) -> Pair:
    seen = ("self._predicted(y, t)", "t + DELAY") if own.predicts else ("y", "t")
    fed = f"self.feedback = self._law({', '.join(seen)})"
    if own.seldom:
        fed = f"self.status = 1 if t > HORIZON else 0\n    if self.sample % EVERY == 0:\n        {fed}"
    acts = "feedback(y, t, c->feedback);"
    if own.predicts:
        acts = "predicted(y, t, c->feedback, x); feedback(x, t + CONTROLLER_DELAY, c->feedback);"
    if own.seldom:  # `since` is what is left of sample/EVERY
        acts = f"if (c->since == 0) {{ {acts} }}\n    c->since++;"
        acts += "\n    if (c->since == CONTROLLER_EVERY) { c->since = 0; }"
    played = "" if own.adds_plan else ", mean_of_plan((self.sample - 1) * SAMPLE_TIME, t)"
    meant = "applied(c->held, c->before, mean);"
    if not own.adds_plan:
        meant = (
            "mean_of_plan((real)(c->sample - 1) * CONTROLLER_SAMPLE_TIME, t, played);\n"
            "        applied(c->held, c->before, played, mean);"
        )
    return Pair(
        f"""
def step(self, y):
    y = tuple(map(float, y))
    self.status = 0
    t = self.sample * SAMPLE_TIME
    f = drift(y)
    estimate = self.q
    if self.sample > 0:
        mean = applied(self.held, self.before{played})
        self.q, estimate = estimator(y, f, self.y, self.f, self.q, mean)
    {fed}
    self.before = self.held
    self.held = tuple(p - q for p, q in zip(self.feedback, estimate))
    self.y, self.f = y, f
    self.sample += 1
    return np.array(self.held)
""",
        f"""
void controller_step(controller_state *c, const real y[N], real u[M]) {{
    const real t = (real)c->sample * CONTROLLER_SAMPLE_TIME;
    real f[N], q[M], mean[M], estimate[M], played[M], x[N];
    int i;
    drift(y, f);
    for (i = 0; i < M; i++) {{ q[i] = c->q[i]; estimate[i] = c->q[i]; }}
    if (c->sample > 0) {{
        {meant}
        estimator(y, f, c->y, c->f, c->q, mean, q, estimate);
    }}
    {acts}
    for (i = 0; i < M; i++) {{
        c->before[i] = c->held[i];
        c->held[i] = c->feedback[i] - estimate[i];
        c->q[i] = q[i];
        u[i] = c->held[i];
    }}
    for (i = 0; i < N; i++) {{ c->y[i] = y[i]; c->f[i] = f[i]; }}
    c->sample++;
}}
""",
    )


def _feedback(own: Loop) -> Pair:
    given = ", *geodesic(x, y)" if own.swept else ""
    told = "" if own.swept else "\n    self.status += 4 if excess > 0.0 and not size > 0.0 else 0"
    gives = "tuple(p + q for p, q in zip(kappa, u))" if own.adds_plan else "kappa"
    return Pair(
        f"""
def _law(self, y, t):
    x, u = on_plan(t)
    kappa, (square, excess, size) = law(y, drift(y), x, flow(x, u), u{given})
    self.status = 1 if t > HORIZON else 0
    self.status += 0 if square < REACH * REACH else 2{told}
    return {gives}
""",
        f"""
static void feedback(const real y[N], real t, real u[M]) {{
    real f[N], xs[N], us[M], vs[N], kappa[M], told[3], first[N], last[N];
    int i;
    on_plan(t, xs, us);
    drift(y, f);
    flow(xs, us, vs);
    {"geodesic(xs, y, first, last);" if own.swept else ""}
    law(y, f, xs, vs, us{", first, last" if own.swept else ""}, kappa, told);
    for (i = 0; i < M; i++) {{ u[i] = kappa[i]{" + us[i]" if own.adds_plan else ""}; }}
}}
""",
    )


def _predicted(own: Loop) -> Pair:
    acting = "a = b = c = self.feedback"
    planned = ""
    if not own.adds_plan:
        acting = """a, b, c = (
            tuple(p + q for p, q in zip(self.feedback, on_plan(t + (k + s) * h)[1]))
            for s in (0.0, 0.5, 1.0)
        )"""
        planned = "".join(
            f"on_plan(t + ((real)k + {share}) * {{NUMBER_h}}, xs, {name});\n        "
            for name, share in (("a", "0.0"), ("b", "0.5"), ("c", "1.0"))
        )
    sums = " ".join(f"{name}[i] = acting[i]{'' if own.adds_plan else f' + {name}[i]'};" for name in "abc")
    return Pair(
        f"""
def _predicted(self, y, t):
    h = NUMBER_h
    for k in range(4):
        {acting}
        y = predictor(y, a, b, c)
    return y
""",
        f"""
static void predicted(const real y[N], real t, const real acting[M], real x[N]) {{
    real from[N], a[M], b[M], c[M], xs[N];
    int i, k;
    for (i = 0; i < N; i++) {{ x[i] = y[i]; }}
    for (k = 0; k < 4; k++) {{
        {planned}for (i = 0; i < M; i++) {{ {sums} }}
        for (i = 0; i < N; i++) {{ from[i] = x[i]; }}
        predictor(from, a, b, c, x);
    }}
}}
""",
    )


TESTED = """
def self_test():
    controller = Controller()
    found = [controller.start(MEASURED[0]), *(controller.step(y) for y in MEASURED)]
    worst = float(np.max(np.abs(np.array(found) - np.array(EXPECTED))))
    if not worst <= TOLERANCE:
        raise ValueError(f"the self-test fails: the largest difference is {worst}")
    return worst

if __name__ == "__main__":
    sys.stdout.write(f"the self-test passes: the largest difference is {self_test():.3g}\\n")
"""
IMPORTED = "import math\nimport sys\nimport numpy as np\n"
