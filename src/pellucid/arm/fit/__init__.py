"""Robots of many joints: base parameters, friction of every joint, consistent inertias, payloads, drive gains."""
