"""Tests of `hybridyn/cli`."""
