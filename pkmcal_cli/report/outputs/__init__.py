"""What `--json` writes: the keys of every command, from which schemas and the page of keys are made."""
