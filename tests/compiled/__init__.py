"""Tests of `hybridyn/compiled`."""
