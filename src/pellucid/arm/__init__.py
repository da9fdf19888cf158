"""Robots of several joints: model, identification, study."""
