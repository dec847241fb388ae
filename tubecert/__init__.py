"""tubecert: certified tracking tubes for control-affine systems with matched uncertainty.

`import tubecert as tc` offers what docs/library.md tells: `tc.load`, `tc.certify` and the rest of `__all__`. Nothing
of it is imported before it is used.
"""

import sys
from types import ModuleType

from tubecert.release import __version__ as __version__

TYPE_CHECKING = False
if TYPE_CHECKING:  # a type checker reads this, and Python the table below: a name stands in both
    from tubecert.errors import SpecError as SpecError
    from tubecert.errors import TargetError as TargetError
    from tubecert.errors import TubecertError as TubecertError
    from tubecert.library.certification import Certification as Certification
    from tubecert.library.certifying import certify as certify
    from tubecert.library.comparing import Comparison as Comparison
    from tubecert.library.comparing import compare as compare
    from tubecert.library.exporting import Exported as Exported
    from tubecert.library.exporting import export as export
    from tubecert.library.metrics import SynthesisedMetric as SynthesisedMetric
    from tubecert.library.metrics import VerifiedMetric as VerifiedMetric
    from tubecert.library.metrics import synth as synth
    from tubecert.library.metrics import verify as verify
    from tubecert.library.pages import Report as Report
    from tubecert.library.pages import report as report
    from tubecert.library.reading import read as read
    from tubecert.library.rechecking import Rechecked as Rechecked
    from tubecert.library.rechecking import recheck as recheck
    from tubecert.library.sampled import SampledCertification as SampledCertification
    from tubecert.library.simulating import simulate as simulate
    from tubecert.library.simulation import SampledSimulation as SampledSimulation
    from tubecert.library.simulation import Simulation as Simulation
    from tubecert.library.specification import Checked as Checked
    from tubecert.library.specification import Specification as Specification
    from tubecert.library.specification import check as check
    from tubecert.library.specification import load as load
    from tubecert.library.specification import specification as specification
    from tubecert.library.sweeping import Swept as Swept
    from tubecert.library.sweeping import sweep as sweep
    from tubecert.progress import Phase as Phase
    from tubecert.progress import Step as Step
    from tubecert.progress import Unit as Unit
    from tubecert.report.gains import Gains as Gains
    from tubecert.verdict import Verdict as Verdict

_ROWS = {
    "errors": "SpecError TargetError TubecertError",
    "library.certification": "Certification",
    "library.certifying": "certify",
    "library.comparing": "Comparison compare",
    "library.exporting": "Exported export",
    "library.metrics": "SynthesisedMetric VerifiedMetric synth verify",
    "library.pages": "Report report",
    "library.reading": "read",
    "library.rechecking": "Rechecked recheck",
    "library.sampled": "SampledCertification",
    "library.simulating": "simulate",
    "library.simulation": "SampledSimulation Simulation",
    "library.specification": "Checked Specification check load specification",
    "library.sweeping": "Swept sweep",
    "progress": "Phase Step Unit",
    "release": "__version__",
    "report.gains": "Gains",
    "verdict": "Verdict",
}
_HOMES = {name: home for home, names in _ROWS.items() for name in names.split()}


class _Package(ModuleType):
    """The package. A room that is called like a function (`report`) is imported by its path, and never hides it."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

if not TYPE_CHECKING:
    __all__ = list(_HOMES)

    def __getattr__(name):
        from importlib import import_module

        if name not in _HOMES:
            hint = "; it is called synth, as the command is" if name == "synthesise" else ""
            raise AttributeError(f"module 'tubecert' has no attribute {name!r}{hint}")
        globals()[name] = value = getattr(import_module(f"tubecert.{_HOMES[name]}"), name)
        return value

    def __dir__():
        return sorted(__all__)
