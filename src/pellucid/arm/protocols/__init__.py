"""Excitations of several joints."""
