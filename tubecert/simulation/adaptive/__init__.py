"""Simulation of certificates with a metric: the closed loops of the paper, integrated fast, and attacked.

In: a model, a plan, gains and a disturbance. Out: `Runs` with their own error estimate. Trusted: no.
Implements: theory 2 to 4b, the loops.

| module | what it does |
|---|---|
| `loops` | what is simulated, what acts on it, and what comes out |
| `engine` | batches of runs as lanes of one vector; their steps are halved until they are near enough |
| `lanes` | the steps of lanes: peaks, what is seen at output times |
| `continuous` | the loops as a system of lanes: feedback, and the stages around the fast part |
| `flows` | (xtilde, sigma_hat, u_a): exact where linear, and caught at the ball of the projection |
| `acting` | the plant's terms, the disturbance, wind and parameters of every lane |
| `geodesics`, `times` | Chebyshev geodesics; the times of the steps, and the plan at them |
| `reading` | a certificate, read back; what it promises about a loop |
| `setting` | plan, times, starts and loops with their gains, certified or chosen |
| `families` | random plans of a family |
| `uncertainty` | random members and adversaries of the certified class |
| `attack`, `campaign` | random runs and the search for the worst; all that one command simulates |
| `judge` | runs against promises; distances from obstacles |
| `figures` | a campaign as files, figures among them |
"""
