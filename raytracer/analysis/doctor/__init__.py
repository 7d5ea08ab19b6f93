"""Diagnosis of an installation: what rt needs here, whether it really works, and what to do where it does not."""
