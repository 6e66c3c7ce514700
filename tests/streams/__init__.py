"""Tests of `hybridyn/streams`."""
