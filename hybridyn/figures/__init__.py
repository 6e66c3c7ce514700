"""Figures of results: what is drawn (`chart`), from what (`motion`, `effects`), how (`figure`, `page`)."""
