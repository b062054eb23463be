"""The sheet to hand over: one page that says what was measured, what it means and how sure that is."""
