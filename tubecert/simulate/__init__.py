"""Simulation: the closed loops of the paper, integrated fast, to attack a certificate.

In: a model, a plan, gains and a disturbance. Out: `Runs` with their own error estimate. Trusted: no. A simulation may
falsify a certificate and never supports one; no trusted room imports this one. Implements: theory 2 to 4b, the loops.

| module | what it does |
|---|---|
| `problem`, `loops`, `runs` | what is simulated, the terms of the loops, and what comes out |
| `engine` | batches of lanes |
| `integrator` | steps are halved until the error estimate is small enough; lanes on all cores |
| `grid` | the times of the steps, the plan at them, and the fast part's exact steps |
| `program` | expressions as arrays for one compiled interpreter |
| `compiled`, `sealed` | compilation; machine code kept between runs, and run only under the user's own seal |
| `layout` | the blocks of the fast part's state: the only place that counts entries |
| `stepping` | one lane: RK4 on the slow part, with the flow of the fast part inside |
| `fast` | (xtilde, sigma_hat, u_a): exact where linear, resolved while projecting |
| `feedback`, `geodesic` | min-norm feedback, disturbance; Chebyshev geodesics by Newton |
| `reading` | a certificate, read back; what it promises about a loop |
| `setting` | plan, times, starts and loops with their gains, certified or chosen |
| `families` | random plans of a family |
| `uncertainty` | random members and adversaries of the certified class |
| `attack`, `campaign` | random runs and the search for the worst; all that one command simulates |
| `judge` | runs against promises; distances from obstacles |
| `record`, `files`, `figures` | a campaign as the records of its summary, as files, as figures |
"""
