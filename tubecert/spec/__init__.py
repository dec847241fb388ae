"""The specification: YAML in, a frozen `Spec` out, or every problem of the file as located findings.

In: the path of a YAML file. Out: `Spec` (exact numbers, expressions with obligations). Trusted: yes.

| module | what it does |
|---|---|
| `source` | reads the text within limits; lines and columns |
| `document` | YAML events -> a tree that knows where each node stands |
| `reader` | a cursor that answers with values or findings |
| `names`, `system`, `plan`, `settings`, `obstacles`, `hardware`, `simulation`, `synthesis` | the sections of the file |
| `table` | a plan file (CSV): text -> exact knots |
| `algebra` | exact checks: definiteness, symmetry, rank |
| `override` | keys that the command line sets, put into the tree |
| `load` | puts the sections together |
| `canonical` | the effective specification as plain data |
| `codes`, `types` | finding codes; the values of a specification |
"""

from tubecert.spec.canonical import canonical
from tubecert.spec.codes import CODES
from tubecert.spec.load import load, load_question, load_text
from tubecert.spec.override import Setting
from tubecert.spec.types import (
    Adaptation,
    Arithmetic,
    Bounds,
    Disturbance,
    Expectation,
    Hardware,
    Interpolation,
    Knots,
    Matrix,
    Metric,
    Obstacle,
    Simulation,
    Spec,
    Synthesis,
    Table,
    Task,
    Term,
    TermMatrix,
    Trajectory,
    Tube,
    Uncertainty,
    Vector,
)

__all__ = [
    "CODES",
    "Adaptation",
    "Arithmetic",
    "Bounds",
    "Disturbance",
    "Expectation",
    "Hardware",
    "Interpolation",
    "Knots",
    "Matrix",
    "Metric",
    "Obstacle",
    "Setting",
    "Simulation",
    "Spec",
    "Synthesis",
    "Table",
    "Task",
    "Term",
    "TermMatrix",
    "Trajectory",
    "Tube",
    "Uncertainty",
    "Vector",
    "canonical",
    "load",
    "load_question",
    "load_text",
]
