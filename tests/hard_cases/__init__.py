"""The hard cases, one file a topic; `python -m tests.hard_cases` prints what each one measures."""
