"""What all simulations do with their runs: distances from obstacles, figures, and the folder that is written.

In: points, figures, summaries. Out: numbers, files. Trusted: no.

| module | what it does |
|---|---|
| `obstacles` | how near points come to an obstacle |
| `plans` | random plans of a family, as lanes |
| `figures` | colours, labels, legends, obstacles in a plane; a figure as files |
| `folder` | a folder that is tried before any work is done, and to which the summary comes last |
"""
