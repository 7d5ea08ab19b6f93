"""Declare what a scene file may say: fields with units and ranges, YAML with line numbers, the registry of kinds."""
