"""Tests of `hybridyn/linkage`."""
