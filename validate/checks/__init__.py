"""Checks of exported replicas in simulators, one module per engine."""
