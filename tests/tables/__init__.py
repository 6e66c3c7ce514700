"""Tests of `hybridyn/tables`."""
