"""The specification: YAML in, a frozen `Spec` out, or every problem of the file as located findings.

In: the path of a YAML file. Out: `Spec` (exact numbers, expressions with obligations). Trusted: yes.

| module | what it does |
|---|---|
| `source` | reads the text within limits; lines and columns |
| `document` | YAML events -> a tree that knows where each node stands |
| `reader` | a cursor that answers with values or findings |
| `keys` | the vocabulary of the table of keys: kinds, keys, sections |
| `system`, `plan`, `start`, `metric`, `tube`, `machine`, `scene` | the table: sections of the file by chapters |
| `names` | the names that expressions may use, and outputs |
| `table` | a plan file (CSV): text -> exact knots |
| `override` | keys that the command line sets, put into the tree |
| `load` | the file as a section, and what holds between sections |
| `canonical` | the effective specification as plain data |
| `codes`, `types`, `values` | finding codes; a specification and what it is made of |
"""

from tubecert.spec.canonical import canonical
from tubecert.spec.load import load, load_text
from tubecert.spec.machine import Hardware, Hold
from tubecert.spec.metric import Synthesis
from tubecert.spec.override import Setting
from tubecert.spec.plan import Afterwards, Bundle, PlanKind, Task
from tubecert.spec.scene import Disc, Obstacle, Simulation
from tubecert.spec.system import Disturbance
from tubecert.spec.types import Spec
from tubecert.spec.values import Interpolation, Knots, Output, Table, Term, Vector

__all__ = [
    "Afterwards", "Bundle", "Disc", "Disturbance", "Hardware", "Hold", "Interpolation", "Knots", "Obstacle",
    "Output", "PlanKind", "Setting", "Simulation", "Spec", "Synthesis", "Table", "Task", "Term", "Vector",
    "canonical", "load", "load_text",
]  # fmt: skip
