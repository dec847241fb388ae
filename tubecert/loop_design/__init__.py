"""Tables for a computer: the linear error equation of a sampled loop -> a controller that keeps its tube small.

In: a `Plant`, in floats. Out: a `Design`, or `NoDesign`, which says what was missing. Trusted: no, and it need not be:
whatever is proposed here, the theorem in `sampled_loop` decides. Deterministic: no random numbers.

| module | holds |
|---|---|
| `plant` | the error equation and the size of all that acts on it, in units of its own |
| `widths` | how far a loop can be driven: exact sums over lags, and their fixed point with the remainder |
| `observer` | weights -> tables, by two Riccati equations |
| `design` | the search for the weights; why nothing was found |
| `proposal` | tables -> stages and a recipe for the theorem, and what fills them |
"""
