"""Seeing a robot: what is drawn (`picture`), where it is (`placing`), on a page or in a file.

visuals -> picture, drawing -> placing -> posing, measures, run -> page, or render and film
"""
