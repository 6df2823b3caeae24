"""Checks of exported replicas in the engines of their users, one module per engine."""
