"""The planner: proposes knots of a plan. Untrusted: whatever it hands over is checked by `trajectory` before use.

In: a planning task and the dynamics. Out: knots.

| module | what it does |
|---|---|
| `rollout` | the dynamics in floats |
| `ilqr` | inputs that lead to the target |
| `propose` | task -> course -> knots, as many as the defect asks for |
| `cache` | inputs kept between runs |
"""
