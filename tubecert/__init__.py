"""tubecert: certified tracking tubes for control-affine systems with matched uncertainty.

`import tubecert as tc` offers what docs/library.md tells: `tc.load`, `tc.certify` and the rest of `__all__`. Nothing
of it is imported before it is used.
"""

import sys
from types import ModuleType

from tubecert.release import __version__

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

    from tubecert.errors import SpecError, TargetError, TubecertError
    from tubecert.library.certification import Certification
    from tubecert.library.certifying import certify
    from tubecert.library.checks import Checked, check
    from tubecert.library.comparing import Comparison, compare
    from tubecert.library.exporting import Exported, export
    from tubecert.library.metrics import SynthesisedMetric, VerifiedMetric, synth, verify
    from tubecert.library.pages import Report, report
    from tubecert.library.reading import read
    from tubecert.library.rechecking import Rechecked, recheck
    from tubecert.library.sampled import SampledCertification
    from tubecert.library.simulating import simulate
    from tubecert.library.simulation import SampledSimulation, Simulation
    from tubecert.library.specification import Specification, load, specification
    from tubecert.library.sweeping import Swept, sweep
    from tubecert.progress import Phase, Step, Unit
    from tubecert.report.gains import Gains
    from tubecert.verdict import Verdict

__all__ = [
    "Certification",
    "Checked",
    "Comparison",
    "Exported",
    "Gains",
    "Phase",
    "Rechecked",
    "Report",
    "SampledCertification",
    "SampledSimulation",
    "Simulation",
    "SpecError",
    "Specification",
    "Step",
    "Swept",
    "SynthesisedMetric",
    "TargetError",
    "TubecertError",
    "Unit",
    "Verdict",
    "VerifiedMetric",
    "__version__",
    "certify",
    "check",
    "compare",
    "export",
    "load",
    "read",
    "recheck",
    "report",
    "simulate",
    "specification",
    "sweep",
    "synth",
    "verify",
]

_HOMES = {
    "Certification": "library.certification",
    "Gains": "report.gains",
    "read": "library.reading",
    "certify": "library.certifying",
    "Checked": "library.checks",
    "check": "library.checks",
    "Comparison": "library.comparing",
    "compare": "library.comparing",
    "Exported": "library.exporting",
    "export": "library.exporting",
    "Swept": "library.sweeping",
    "SynthesisedMetric": "library.metrics",
    "VerifiedMetric": "library.metrics",
    "synth": "library.metrics",
    "verify": "library.metrics",
    "Rechecked": "library.rechecking",
    "Report": "library.pages",
    "SampledCertification": "library.sampled",
    "SampledSimulation": "library.simulation",
    "Simulation": "library.simulation",
    "simulate": "library.simulating",
    "Specification": "library.specification",
    "load": "library.specification",
    "specification": "library.specification",
    "SpecError": "errors",
    "TargetError": "errors",
    "TubecertError": "errors",
    "Phase": "progress",
    "Step": "progress",
    "Unit": "progress",
    "Verdict": "verdict",
}
_ROOMS = {
    "recheck": "library.rechecking",
    "report": "library.pages",
    "sweep": "library.sweeping",
}


class _Room(ModuleType):
    """A room of the package whose name is that of a function of the library: it can be called as that function."""

    def __call__(self, *arguments: object, **options: object) -> object:
        return self._function()(*arguments, **options)

    @property
    def __signature__(self) -> object:
        import inspect

        return inspect.signature(self._function())

    def _function(self) -> "Callable[..., object]":
        name = self.__name__.rpartition(".")[2]
        function: Callable[..., object] = getattr(_module(_ROOMS[name]), name)
        return function


class _Package(ModuleType):
    """The package: whoever imports one of those rooms first, it can be called."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in _ROOMS and isinstance(value, ModuleType):
            value.__class__ = _Room
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

if not TYPE_CHECKING:  # a type checker knows what there is

    def __getattr__(name):
        if name in _HOMES:
            value = getattr(_module(_HOMES[name]), name)
        elif name in _ROOMS:
            value = _module(name)
        else:
            hint = "; it is called synth, as the command is" if name == "synthesise" else ""
            raise AttributeError(f"module 'tubecert' has no attribute {name!r}{hint}")
        globals()[name] = value
        return value

    def __dir__():
        return sorted(__all__)


def _module(name: str) -> ModuleType:
    from importlib import import_module

    return import_module(f"tubecert.{name}")
