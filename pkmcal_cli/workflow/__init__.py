"""What each subcommand does, between its arguments and its exit code."""
