"""Tests of `hybridyn/oracle`."""
