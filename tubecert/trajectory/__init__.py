"""Plans: the curve x*(t), its input u*(t), and how far it is from satisfying the dynamics.

In: the trajectory of a specification. Out: a `Plan` that encloses itself over any window of time, with a proven bound
of its defect p = x*' - f(x*) - B(x*) u*. Trusted: yes, but for the planner.

| module | what it does | trusted |
|---|---|---|
| `plan` | a plan as expressions of t: what every plan can be asked; every plan at once; sup |p| | yes |
| `pieces`, `hermite` | a plan through knots: cubic Hermite pieces, and their data as intervals | yes |
| `make` | specification -> plan; sub-knots until the defect is negligible; whether it goes on | yes |
"""

from tubecert.trajectory.plan import Plan, constant_plan, inputs

__all__ = ["Plan", "constant_plan", "inputs"]
