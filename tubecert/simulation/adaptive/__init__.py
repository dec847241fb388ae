"""Simulation of certificates with a metric: the closed loops of the paper, integrated fast, and attacked.

In: a model, a plan, gains and a disturbance. Out: `Runs` with their own error estimate. Trusted: no.
Implements: theory 2 to 4b, the loops.

| module | what it does |
|---|---|
| `loops` | what is simulated, what acts on it, and what comes out: records of lanes |
| `engine` | batches of runs as lanes of one vector; their steps are halved until they are near enough |
| `continuous` | lanes from start to end: plant, disturbance, feedback, and the stages around the fast part; peaks |
| `flows` | (xtilde, sigma_hat, u_a): exact where linear, and caught at the ball of the projection |
| `geodesics`, `times` | Chebyshev geodesics; the times of the steps, and the plan at them |
| `setting` | a certificate, read back: plan, starts; loops, their gains, certified or chosen, and their promises |
| `families` | random plans of a family |
| `uncertainty` | random members and adversaries of the certified class |
| `campaign` | all that one command simulates: loops, random runs, and a search for the worst |
| `judge` | runs against promises; distances from obstacles |
| `figures` | a campaign as files, figures among them |
"""
