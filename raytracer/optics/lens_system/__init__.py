"""Trace real lenses: surfaces, stops, pupils, focus and reflections, and the importers of lens files."""
