"""What other formats, and people, call things: what to write here instead.

In: a key or a value that is not understood, and where it stands. Out: a sentence. Nothing is accepted in its place.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final

from tubecert.expression import near, suggestion

_SAME: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        ("T", "Tf", "tf", "t_f", "t_end", "tend", "t_final", "duration", "time", "length"), "horizon"
    ),
    **dict.fromkeys(("x", "x0", "x_star", "xstar", "position", "state", "point", "xe", "x_eq"), "at"),
    **dict.fromkeys(("u", "u0", "u_star", "ustar", "inputs", "ue", "u_eq"), "input"),
    **dict.fromkeys(("path", "filename", "csv", "data"), "file"),
    **dict.fromkeys(("Ts", "dt", "T_s", "period", "sampling_time", "step"), "sample_time"),
    **dict.fromkeys(("omega", "w_c", "cutoff"), "bandwidth"),
    **dict.fromkeys(("Gamma", "gamma"), "adaptation_rate"),
    **dict.fromkeys(("latency", "lag", "dead_time", "deadtime", "computation_time"), "delay"),
    **dict.fromkeys(("noise_bound", "measurement_noise", "sensor_noise"), "noise"),
    **dict.fromkeys(("r", "size"), "radius"),
    **dict.fromkeys(("constants", "consts", "values", "coefficients"), "parameters"),
    **dict.fromkeys(("samples", "trials", "count", "n"), "runs"),
    **dict.fromkeys(("max", "maximum", "magnitude", "w", "w_max"), "bound"),
    **dict.fromkeys(("dynamics", "plant", "model", "ode"), "system"),
    **dict.fromkeys(("plan", "reference_trajectory"), "trajectory"),
    **dict.fromkeys(("bounds", "state_bounds", "state_constraints", "region", "set"), "safe_set"),
    **dict.fromkeys(("corners", "vertices", "points"), "polygon"),
    **dict.fromkeys(("goal", "end", "final", "x_goal", "xf"), "target"),
    **dict.fromkeys(("u_rate", "slew_rate", "input_rates", "udot", "u_dot"), "input_rate"),
    **dict.fromkeys(("after", "then", "at_end"), "afterwards"),
    **dict.fromkeys(("precision", "float", "dtype"), "arithmetic"),
    "W_x": "dual_metric",
    **dict.fromkeys(("controls", "control"), "inputs"),
}
"""Keys that are another one by another name, where that one may stand."""

_SECOND: Final[Mapping[str, str]] = {"x": "target", "u": "inputs"}
"""The same, where the first meaning may not stand."""

_KEYS: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        ("saturation", "saturations", "input_limits", "u_max", "u_min", "actuators"),
        "limits of the inputs are the key limits: {NAME: [low, high]}",
    ),
    **dict.fromkeys(("x0", "start", "initial", "initial_condition"), "write initial_state: {at: [...]}"),
    **dict.fromkeys(("reference", "path", "setpoint", "desired"), "the plan is the key trajectory"),
    **dict.fromkeys(
        ("disturbances", "wind"),
        "what acts beside the inputs is the key disturbance, what acts through them is uncertainty",
    ),
    **dict.fromkeys(
        ("noise", "delay", "sensors", "sample_time", "sampling", "computer", "machine"),
        "the machine is the key hardware: {rate: 500, delay: 0.001, noise: 0.001}",
    ),
    **dict.fromkeys(
        ("constraints", "domain", "bounds_x"), "the box that the tube must stay in is the key safe_set"
    ),
    **dict.fromkeys(
        ("rho", "radius", "width"),
        "how wide the tube is follows from epsilon and rho_a, or is given by state: half_widths: {NAME: 0.1}",
    ),
    **dict.fromkeys(("W", "dual", "matrix"), "the inverse of the metric is the key dual_metric"),
    **dict.fromkeys(("M", "P"), "the metric is given by its inverse, W = M^-1: the key dual_metric"),
    **dict.fromkeys(("lambda", "lam", "decay"), "the contraction rate is the key rate, in 1/s"),
    **dict.fromkeys(("synthesize", "synthesis", "synth"), "to have a metric found write synthesise: {}"),
    **dict.fromkeys(("g", "G"), "the matrix of the inputs is the key B"),
    **dict.fromkeys(("title", "system_name"), "the name of the specification is the key name"),
    **dict.fromkeys(("version", "format"), "the version of the format is the key tubecert: 1"),
    **dict.fromkeys(("frequency", "freq", "hz", "Hz"), "the sample rate is the key rate, in Hz"),
    **dict.fromkeys(
        ("Gamma", "gamma", "omega", "bandwidth", "adaptation_rate", "gains"),
        "gains are found; certify --bandwidth W --adaptation-rate G proves some of your own",
    ),
    **dict.fromkeys(
        ("feedforward", "feedback_rate", "predict", "geodesic"),
        "certificate H, which knew it, is gone; leave it out",
    ),
    "windows": "windows of time are gone: one tube holds for the whole plan; leave it out, or ask for half_widths",
    "control_rate": "the computer that holds the input is the key hardware: {rate: 500}",
    "noise_rate": "noise is arbitrary from sample to sample in what is proven: leave it out",
    "kernel": "there is one kernel, the tight one, which is never worse; leave it out",
    "Q": "Q follows from A_m: with P = I it is -(A_m + A_m'); leave it out",
    **dict.fromkeys(("circle", "sphere", "ball"), "a round obstacle is a disc: {center: [...], radius: ...}"),
    **dict.fromkeys(("d", "delta", "matched"), "the uncertainty is the key h, an expression per input"),
    "A": 'f is written out, an expression per state: f: [v, "-3*p - 0.5*v"]',
    **dict.fromkeys(
        ("C", "y"),
        "every state is known, up to hardware.noise; what is to have a half-width is named in system.outputs",
    ),
    **dict.fromkeys(("box", "rectangle", "square"), "a rectangle is a polygon of four corners"),
    "file": "the file of a metric is given by --metric FILE, that of a plan by kind: csv",
}
"""Keys that other formats have, and what there is of them here."""

_PLACES: Final[Mapping[str, str]] = {
    **dict.fromkeys(("epsilon", "rho_a", "half_widths"), "tube"),
    **dict.fromkeys(
        ("states", "inputs", "parameters", "tables", "definitions", "outputs", "f", "B"), "system"
    ),
    "dual_metric": "metric",
    "h": "uncertainty",
    "E": "disturbance",
    "horizon": "trajectory",
    "gap": "tube",
}
"""Where keys belong that are often written elsewhere."""

_SECTIONS: Final = frozenset(
    {
        *("name", "system", "safe_set", "uncertainty", "trajectory", "initial_state", "metric", "tube"),
        *("adaptation", "conditions", "obstacles", "hardware", "controller", "disturbance", "limits"),
        *("simulation", "expect"),
    }
)
"""Keys of the file itself, of which one that is indented too far ends in the section above it."""

_MEANT: Final[Mapping[str, tuple[str, ...]]] = {
    "W": ("dual_metric",),
    "lambda": ("rate",),
    "g": ("B",),
    "title": ("name",),
    "version": ("tubecert",),
    **dict.fromkeys(("synthesize", "synthesis", "synth", "file"), ("dual_metric", "rate")),
}
"""Required keys that a key of another format stands for: they are not called missing as well."""

OTHER_WORDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        (
            *("regulation", "setpoint", "point", "constant", "hover", "hold", "rest", "origin"),
            *("stabilise", "stabilize"),
        ),
        "equilibrium",
    ),
    **dict.fromkeys(("tracking", "trajectory", "expression", "function", "analytic"), "expressions"),
    **dict.fromkeys(("table", "file", "spline", "waypoints", "samples"), "csv"),
    **dict.fromkeys(("optimal", "planner", "plan", "ddp", "lqr", "mpc", "ocp"), "ilqr"),
    **dict.fromkeys(("proven", "proved", "ok"), "certified"),
    **dict.fromkeys(("yes", "on", "1"), "true"),
    **dict.fromkeys(("no", "off", "0"), "false"),
    **dict.fromkeys(("float", "float32", "f32"), "single"),
    **dict.fromkeys(("float64", "f64"), "double"),
    **dict.fromkeys(("mid", "midpoint", "mean", "average"), "middle"),
    **dict.fromkeys(("zoh", "start"), "left"),
    **dict.fromkeys(("stop", "stay"), "rest"),
    **dict.fromkeys(("loop", "periodic", "cycle", "again"), "repeat"),
}
"""Words that other formats have for a choice."""

GONE: Final[Mapping[str, str]] = {
    **dict.fromkeys(("C", "c"), "certificate C is gone: let B decide"),
    **dict.fromkeys(
        ("H", "h", "D", "sampled", "hardware"),
        "name the computer, hardware: {rate: 500}, and leave conditions and the metric out: its loop is proven then",
    ),
    "exact": "what a computer rounds is part of what is proven: write double or single",
}
"""Words that there once were, or that belong elsewhere, and what to do instead."""

NO_NUMBER: Final[Mapping[str, str]] = {
    "largest": "no machine and no disturbance is searched for now: write a number"
}
"""The same where a number belongs."""

EXAMPLES: Final[Mapping[str, str]] = {
    "horizon": "5, in s",
    "rate": "1, in 1/s",
    "file": "plan.csv",
    "tubecert": "1",
    "target": "[...], one number per state",
    "at": "[...], one number per state",
    "input": "[...], one number per input",
}
"""Values of keys that are missing, where that says more than dots."""


def same_as(key: str, known: Sequence[str]) -> str | None:
    """The known key that a word stands for, if it plainly stands for one."""
    for other in (_SAME.get(key), _SECOND.get(key)):
        if other in known:
            return other
    return None


def glued(key: str, known: Collection[str]) -> str:
    """What to write for {x:1}, which YAML reads as one word; empty if it is none."""
    name, colon, value = key.partition(":")
    return f"write `{name}: {value[:40]}`, with a blank after the colon" if colon and name in known else ""


def of_key(key: str, known: Sequence[str]) -> tuple[str, list[str]]:
    """What to write in place of an unknown key, and the known ones that it may stand for."""
    if key.isdecimal():
        return "if a comma was meant as a decimal point, write the point: 0.1", []
    if (other := same_as(key, known)) is not None:
        return f"it is called {other}: {EXAMPLES.get(other, '...')}", [other]
    if key in _PLACES:
        meant = _MEANT.get(key, ()) if key in _KEYS else ()
        return f"it belongs to {_PLACES[key]}: {_PLACES[key]}.{key}", list(meant)
    close = near(key, known)
    if key in _SECTIONS and not close:
        return f"{key} is a section of the file: write it without indentation, beside system", []
    advice = _KEYS.get(key) or suggestion(key, known, what="known keys")
    return advice, list(_MEANT.get(key, ())) if key in _KEYS else close


def of_value(path: str, text: str) -> str:
    """What to write for a section that is given as one word, or as a list (an empty text); empty if nobody knows."""
    word = text.strip()
    match path:
        case "" if word.count(",") + word.count(";") > 1:
            return "a plan stands in a specification: trajectory: {kind: csv, file: FILE}"
        case "trajectory" if word.lower().endswith((".csv", ".txt", ".dat")):
            return f"write {{kind: csv, file: {word[:60]}}}"
        case "trajectory":
            return "for a point that is held write {kind: equilibrium, at: [...]}, one number per state"
        case "metric" if word.lower().endswith((".json", ".csv", ".npz", ".mat", ".yaml")):
            return f"the file of a metric is given on the command line: --metric {word[:60]}"
        case "metric":
            return "to have a metric found write metric: {synthesise: {}}; a known one is {dual_metric: ..., rate: ...}"
        case "metric.synthesise":
            return "write synthesise: {}, or its wishes in the braces: {rate: 1}"
        case "uncertainty" if word.replace(".", "", 1).isdecimal():
            bounds = f"{{bounds: {{h: {word[:20]}, h_x: ..., h_t: ...}}}}"
            return f"for a bound write {bounds}, else {{h: [...]}}, an expression per input"
        case "tube":
            return (
                "write {half_widths: {NAME: 0.1}}: how far each state may be from the plan, in its own unit"
            )
        case "hardware.noise":
            return "noise by state is written {NAME: size}; one number bounds the length of the error"
        case "uncertainty":
            return 'write {h: ["0.1*sin(t)"]}, an expression per input; {h: ["0"]} if there is none'
        case "conditions" if word:
            return f"write {{decides: {word[:20]}}}"
        case "hardware" if word:
            return f"write {{rate: {word[:20]}}}, in Hz"
        case "initial_state":
            return "write {at: [...]}, one number per state"
        case "system.states" | "system.inputs" if word.isdecimal():
            return "give them names: [x1, x2]"
        case "obstacles":
            return "write a list with an entry for every obstacle: [{disc: {center: [...], radius: ...}}]"
    return ""
