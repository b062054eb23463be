"""Results as tables for people (stderr) and as JSON (stdout)."""
