"""What every room may use: errors, files, families, rotations, sparse maps."""
