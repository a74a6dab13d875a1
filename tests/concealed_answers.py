"""Truths and findings made by hand, for the trial's score."""


def truth(*effects, name="s", outside=(), masked=False):
    """effects: (effect, where, parameters)."""
    specs = [{"effect": e, "where": w, "parameters": p} for e, w, p in effects]
    return {"name": name, "robot": "rig", "effects": specs, "masked": masked, "outside": list(outside), "takes": {}}


def finding(effect, where, confidence=0.95, tie=None, **values):
    """values: parameter -> (value, low, high)."""
    parameters = {k: {"value": v, "low": low, "high": high, "unit": ""} for k, (v, low, high) in values.items()}
    ties = [{"effect": tie, "where": where, "confidence": 0.3}] if tie else []
    return {"effect": effect, "where": where, "confidence": confidence, "parameters": parameters, "alternatives": ties}


def said(*findings, verdict="explained"):
    """findings.json."""
    return {"verdict": verdict, "findings": list(findings), "provenance": {"seconds": 60}}
