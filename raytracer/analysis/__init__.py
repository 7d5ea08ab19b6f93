"""Measure, compare and explain renders: one package a tool."""
