"""Metric synthesis: proposals of a dual metric. Untrusted: what is proposed is proven by `tubecert.metric.verify`.

| module | what it does |
|---|---|
| `family`, `frame`, `lifting` | matrices W(x) that satisfy C3 exactly, for any B; what measures them |
| `problem` | what a route is asked, and answers |
| `forms`, `conic` | the conditions as matrices in the coefficients, sign symmetries; semidefinite programs |
| `cegis`, `attack` | route: conditions at points, and where they fail |
| `sos`, `polynomial`, `chart` | route: sums of squares |
| `rounding` | floats -> few digits, proven |
| `coefficients` | metrics as other tools keep them |
| `ladder` | degrees, routes and back-offs until a proof succeeds; searches over rates and boxes |
| `diagnose` | uncontrollable modes: why there is no metric |
"""
