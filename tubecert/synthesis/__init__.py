"""Metric synthesis: proposals of a dual metric. Untrusted: what is proposed is proven by `tubecert.metric.verify`.

| module | what it does |
|---|---|
| `family`, `pivot_frame`, `frame`, `lifting` | matrices W(x) that satisfy C3 exactly, for any B |
| `problem` | what a route is asked, and answers |
| `forms`, `parity`, `conic` | the conditions as matrices in the coefficients; sign symmetries; Clarabel and SCS |
| `cegis`, `program`, `sampling`, `attack`, `counterexample` | route: conditions at points, and where they fail |
| `sos`, `polynomial`, `chart`, `gram` | route: sums of squares |
| `rounding` | floats -> few digits, proven |
| `ladder`, `routes` | degrees, routes and back-offs until a proof succeeds; searches over rates and boxes |
| `diagnose` | uncontrollable modes: why there is no metric |
"""
