"""Diagnoses of look-alikes of real campaigns, judged: `python -m tests.lookalikes`."""
