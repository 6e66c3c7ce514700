"""Hard cases: each states its claim, a measured number and its bound."""
