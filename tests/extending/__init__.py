"""Tests of what other packages add, `hybridyn/extensions.py`."""
