"""Tests of `hybridyn/assembly`."""
