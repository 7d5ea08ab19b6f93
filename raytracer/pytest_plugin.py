"""Regression tests of scenes for pytest: the fixture `rt_regression`."""
