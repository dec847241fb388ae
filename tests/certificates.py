"""A small certificate by hand, in the form of the contract, for tests of what is made of certificates."""

import copy

_EFFECTIVE = {
    "tubecert": 1, "name": "pendulum",
    "system": {"states": ["angle", "speed"], "inputs": ["torque"], "units": {"angle": "rad", "speed": "rad/s"}},
    "trajectory": {"kind": "equilibrium", "at": ["0", "0"], "input": ["0"]},
}  # fmt: skip

_CONSTANTS = {
    "lower": {
        "below": 3.8123456, "above": 3.83, "symbol": "a", "equation": "CCM_1", "unit": "1",
        "at": {"x": [0.01, -0.02]},
    },
    "h": {
        "below": 0.1, "above": 0.1, "symbol": "Dh", "equation": "assumption 4", "unit": "u",
        "at": {"t": 0.785398163, "x": [0.0, 0.0]},
    },
    "zeta_1": {"below": 1.5, "above": 1.6, "symbol": "zeta1", "equation": "26a", "unit": "1"},
}  # fmt: skip

_RESULT = {
    "verdict": "certified",
    "spec": {"effective": _EFFECTIVE, "effective_hash": "sha256:00", "file_hash": "sha256:01"},
    "claim": {
        "id": "tube", "horizon": None, "for_all_time": "autonomous", "period": None,
        "domain": {"angle": ["-0.5", "0.5"], "speed": ["-1", "4/3"]}, "start": {"at": ["0", "0"]},
        "uncertainty": "expression",
    },
    "overrides": {}, "effort": {"gap": 0.01, "budget": 2000000},
    "plan": {"kind": "equilibrium", "interpolation": "exact"},
    "safe_set": {"angle": [-0.5, 0.5], "speed": [-1.0, "4/3"]},
    "assumptions": [{"id": "least_feedback"}, {"id": "for_all_time"}], "declared": {},
    "decided_by": ["conditions_26"],
    "reasons": [
        {
            "claim": "gains_suffice", "section": "conditions_26", "binds": "26a",
            "margins": {"26a": 0.000123, "26b": 0.63, "26c": 4.1e-05}, "verdict": "certified",
            "relax": [{"id": "halve_constant", "constant": "h", "factor": 0.37}],
        },
    ],
    "metric": {
        "rate": 0.9999, "dual_metric": [["1", "0"], ["0", "1"]], "verdict": "certified",
        "margin": [2.41e-05, 2.42e-05], "largest_rate": [0.9999241, 0.9999242], "lower": [3.8123456, 3.83],
        "upper": [5.8, 5.8412345], "lower_on_set": [3.7, 3.71], "upper_on_set": [5.9, 5.91],
    },
    "tube": {
        "epsilon": 0.01, "rho_a": 0.01, "rho_r": 0.0312345678, "rho": 0.0412345678,
        "half_widths": {"angle": 0.0398765, "speed": 0.0412345},
    },
    "constants": _CONSTANTS,
    "conditions_26": {
        "verdict": "certified", "bandwidth": 41.82, "adaptation_rate": 13940000.0, "predictor_gain": 10.0,
        "projection_radius": 0.1, "ultimate_radius": None, "bandwidth_infimum": 41.8,
        "margins": {"26a": [0.000123, 0.02], "26b": [0.63, 0.64], "26c": [4.1e-05, 0.03]},
        "least_adaptation": {
            "bandwidth": 48.0, "adaptation_rate": 12340000.0, "predictor_gain": 12.0,
            "projection_radius": 0.1,
            "margins": {"26a": [0.05, 0.06], "26b": [0.7, 0.8], "26c": [2e-05, 0.03]},
        },
        "binds": "26a", "shortfalls": [],
    },
    "distance": {
        "verdict": "certified",
        "split": {
            "bandwidth": 7.5, "adaptation_rate": 30000.0, "predictor_gain": 7.5, "projection_radius": 0.1,
            "margin": [0.0001, 0.01], "ultimate_radius": 0.013,
        },
        "least_adaptation": {
            "bandwidth": 10.8, "adaptation_rate": 13800.0, "predictor_gain": 10.8, "projection_radius": 0.1,
            "margin": [0.0002, 0.01], "ultimate_radius": 0.0123,
        },
        "asked": None, "ultimate_radius": 0.0123, "shortfalls": [],
    },
    "proof": {},
}  # fmt: skip

_TUBE_KEYS = ("tube", "constants", "conditions_26", "distance", "decided_by")


def certified(**changes):
    """A result whose every certificate holds."""
    return copy.deepcopy(_RESULT) | changes


def refuted_metric():
    """A result that stops at the metric, with a witness."""
    result = {key: value for key, value in certified().items() if key not in _TUBE_KEYS}
    reason = {
        "claim": "metric_contraction",
        "rate": 1.0,
        "largest_rate": [0.99654, 0.99655],
        "verdict": "refuted",
        "at": {"x": [0.1, -0.25]},
        "relax": [{"id": "lower_rate", "to": 0.99654}, {"id": "other_metric"}],
    }
    return result | {
        "verdict": "refuted",
        "reasons": [reason],
        "metric": result["metric"] | {"verdict": "refuted"},
    }


def refuted_gains():
    """A result for gains asked for that do not suffice."""
    result = certified(verdict="refuted", overrides={"bandwidth": 5.0, "adaptation_rate": 100.0})
    result["conditions_26"] |= {
        "verdict": "refuted",
        "bandwidth": 5.0,
        "adaptation_rate": 100.0,
        "margins": {"26a": [-0.5, -0.4], "26b": [0.2, 0.3], "26c": [None, -3.0]},
    }
    result["distance"] |= {
        "asked": {
            "bandwidth": 5.0,
            "adaptation_rate": 100.0,
            "predictor_gain": 5.0,
            "projection_radius": 0.1,
            "margin": [None, -1.0],
            "ultimate_radius": None,
        },
        "verdict": "refuted",
    }
    result["reasons"] = [
        {
            "claim": "condition_holds",
            "section": "conditions_26",
            "condition": "26a",
            "margin": [-0.5, -0.4],
            "verdict": "refuted",
        }
    ]
    return result


def undecided():
    """A result whose metric could not be decided."""
    result = refuted_metric()
    result["reasons"][0] |= {"verdict": "undecided"}
    del result["reasons"][0]["at"]
    return result | {"verdict": "undecided"}
