"""Re-verification of a certificate in a second arithmetic: python-flint's balls, no solver, nothing of the producer.

In: the text of a certificate. Out: every claim that its verdict rests on, confirmed, contradicted or undecided.
Trusted: yes. Imports of this package only `errors` and `findings`: a misread text, a wrong derivative, kernel,
formula or rounding in the producer must not pass both.

| module | what it does |
|---|---|
| `balls` | ball arithmetic: exact numbers, ends, norms, positive definite matrices |
| `grammar`, `terms`, `program` | text to terms with derivative rules of this room's own; evaluated on balls |
| `monomials` | the same as exact combinations of monomials: a whole matrix with its derivatives by one product |
| `identity` | terms that vanish identically, by polynomials over the rationals and the addition theorems |
| `boxes` | what terms can be on a box: polynomials of second order, their vertices, and what they leave |
| `statements` | norms, definiteness and signs at those vertices |
| `pencils`, `norms`, `lipschitz` | statements of other kinds: pencils, columns over a ball, kinks |
| `cover` | one claim; a claim over a domain, by splitting boxes that cover it |
| `curve`, `tube` | the plan as segments that enclose it, or a family of plans; boxes around it |
| `document`, `specified.numbers` | JSON and expressions, read and checked for form |
| `specification` with its parts in `specified`, `certificate` | closed types of all that a certificate may say |
| `plans`, `reasons` | their parts; whether a plan is what it should be |
| `examines` | every key of a result, and the claim that examines it |
| `system`, `times` | the system that a specification describes; the times that matter for h |
| `metric`, `place`, `constants`, `start`, `geodesics` | claims about the metric, suprema, the start |
| `wind` | claims about a disturbance, and about parameters of which ranges are known |
| `conditions` | the theorems A and B at printed numbers |
| `kinds` | the section of each kind of certificate: how it is read, what is examined of it |
| `consistency`, `refuted` | what must agree, and what is claimed; what refutes |
| `claims` | all claims in their order |
"""
