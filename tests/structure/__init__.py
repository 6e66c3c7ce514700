"""Tests of `hybridyn/structure`."""
